"""`cpbench pack`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from cpbench import storage
from cpbench.cli.options import Command, force_option
from cpbench.cli.routes import sizes_line
from cpbench.errors import FormatError
from cpbench.storage.base import require_new
from cpbench.storage.hdf5_files import SUFFIXES
from cpbench.storage.packing import parts as pack_parts
from cpbench.storage.packing import remarks as pack_remarks
from cpbench.storage.packing import steps as pack_steps
from cpbench.storage.packing.parts import Part

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
@click.option("--name", default="", help="Name of the problem, or of the sequence (default: name of the file).")
@click.option("--sequence", is_flag=True, help="One problem a step, so that cpbench run --start previous follows them.")
@click.option("--problems", type=_FILE, metavar="PATH", help="with --sequence: steps that are problem files or a pack")
@click.option("--dt", type=click.FloatRange(min=0, min_open=True), help="with --sequence: size of a step [s]")
@click.option("--ids", type=_FILE, metavar="PATH", help="with --sequence: the number by which each contact is known")
@click.option("--positions", type=_FILE, metavar="PATH", help="with --sequence: where contacts are, nc x 3 [m]")
@force_option
def command(output: Path, name: str, force: bool, axes: str | None, sequence: bool, **given: Any) -> None:
    """Make a problem file from matrices and vectors in .npy, .npz, .mtx or .csv files.

    With --sequence every PATH is a folder or a glob with one file a step (in the order of the numbers in their names),
    or an array with the steps as first dimension; what has no steps is the same in all:

    \b
      cpbench pack scene.h5 --sequence --dt 1e-3 --fc 'W*.npz' 'q*.npy' mu.npy --ids 'ids*.npy'
      cpbench pack scene.h5 --sequence --dt 1e-3 --problems steps/ --ids ids.npy
      cpbench run scene.h5 --start previous,cold
    """
    if sequence:
        _pack_steps(output, name, force, axes, given)
        return
    for option in ("problems", "dt", "ids", "positions"):
        if given[option] is not None:
            raise click.UsageError(f"--{option} goes with --sequence")
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
    for remark in pack_remarks.remarks(problem) if node in ("fc", "gfc") else ():
        click.echo(f"remark: {remark}", err=True)


def _pack_steps(output: Path, name: str, force: bool, axes: str | None, given: dict[str, Any]) -> None:
    kinds = [kind for kind in ("fc", "gfc", "problems") if given[kind]]
    others = [kind for kind in ("lcp", "mlcp", "qp", *_MORE) if given[kind]]
    if len(kinds) != 1 or others:
        raise click.UsageError("--sequence takes one of --fc, --gfc, --problems: a sequence has contact problems")
    if given["dt"] is None:
        raise click.UsageError("--sequence needs the size of a step: --dt SECONDS")
    if given["problems"] and axes is not None:
        raise click.UsageError("--axes goes with --fc and --gfc, not with --problems")
    if output.suffix.lower() not in SUFFIXES:
        raise FormatError(output, "", f"a sequence is HDF5: expected a name that ends in {' or '.join(SUFFIXES)}")
    require_new(output, force)
    recorder = storage.Recorder(name or output.stem, given["dt"])
    known = {option: given[option] for option in ("ids", "positions") if given[option] is not None}
    if kinds == ["problems"]:
        pack_steps.record_problems(recorder, given["problems"], known)
    else:
        files = dict(zip(_PARTS[kinds[0]], given[kinds[0]], strict=True))
        pack_steps.record(recorder, kinds[0], files, known, axes)
    recorder.save(output, force=force)
    counts = [step.nc for step in recorder.steps]
    click.echo(f"{output} ({recorder.steps[0].node}: {len(counts)} steps, {min(counts)} to {max(counts)} contacts)")
    if any(step.contacts is None or not step.contacts.count for step in recorder.steps if step.nc):
        cold = ", and are cold where their number changes" if min(counts) < max(counts) else ""
        click.echo(
            f"no ids and no positions of contacts (--ids, --positions): starts from the step before match contacts by "
            f"their order{cold}",
            err=True,
        )


def _read(node: str, part: str, file: Path) -> Part:
    read = storage.read_matrix if pack_parts.is_matrix(node, part) else storage.read_vector
    return Part(file, read(file))
