"""`cpbench pack`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from cpbench import storage
from cpbench.cli import pack_parts
from cpbench.cli.options import Command, force_option
from cpbench.cli.pack_parts import Part
from cpbench.cli.routes import sizes_line
from cpbench.storage.base import require_new

_FILE = click.Path(path_type=Path)
_PARTS = {"lcp": "Mq", "mlcp": "ABCDab", "qp": "Qp", "fc": ("W", "q", "mu"), "gfc": ("M", "H", "f", "w", "mu")}
"""What the files after an option are, in their order."""
_MORE = {"inequality": "Ab", "equality": "Cd", "bounds": ("lb", "ub")}
"""The same of the options that go with --qp."""


@click.command(cls=Command)
@click.argument("output", type=_FILE)
@click.option("--lcp", nargs=2, type=_FILE, metavar="M q", help="0 <= z _|_ Mz + q >= 0")
@click.option("--mlcp", nargs=6, type=_FILE, metavar="A B C D a b", help="Au + Cv + a = 0, 0 <= v _|_ Du + Bv + b >= 0")
@click.option("--qp", nargs=2, type=_FILE, metavar="Q p", help="min 1/2 z'Qz + p'z")
@click.option("--inequality", nargs=2, type=_FILE, metavar="A b", help="with --qp: Az >= b")
@click.option("--equality", nargs=2, type=_FILE, metavar="C d", help="with --qp: Cz = d")
@click.option("--bounds", nargs=2, type=_FILE, metavar="lb ub", help="with --qp: lb <= z <= ub")
@click.option("--fc", nargs=3, type=_FILE, metavar="W q mu", help="frictional contact, local")
@click.option("--gfc", nargs=5, type=_FILE, metavar="M H f w mu", help="frictional contact, global")
@click.option(
    "--axes",
    type=click.Choice(["NTT", "TTN", "NT", "TN"]),
    default=None,
    help="Order of the rows of a contact (default: normal first).",
)
@click.option("--name", default="", help="Name of the problem (default: name of the file).")
@force_option
def command(output: Path, name: str, force: bool, axes: str | None, **given: Any) -> None:
    """Make a problem file from matrices and vectors in .npy, .npz, .mtx or .csv files."""
    kinds = [kind for kind in _PARTS if given[kind]]
    if len(kinds) != 1:
        raise click.UsageError("give exactly one of --lcp, --mlcp, --qp, --fc, --gfc")
    node = kinds[0]
    for option in (name for name in _MORE if given[name] and node != "qp"):
        raise click.UsageError(f"--{option} goes with --qp, not with --{node}")
    if axes is not None and node not in ("fc", "gfc"):
        raise click.UsageError(f"--axes goes with --fc and --gfc, not with --{node}")
    require_new(output, force)
    files = dict(zip(_PARTS[node], given[node], strict=True))
    for option, parts in _MORE.items():
        files |= dict(zip(parts, given[option] or (), strict=False))
    problem = pack_parts.build(
        node, {part: _read(node, part, file) for part, file in files.items()}, axes, name or output.stem
    )
    storage.save(problem, output, force=force)
    click.echo(f"{output} ({problem.node}: {sizes_line(problem)})")


def _read(node: str, part: str, file: Path) -> Part:
    read = storage.read_matrix if pack_parts.is_matrix(node, part) else storage.read_vector
    return Part(file, read(file))
