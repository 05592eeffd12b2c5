"""Make a problem file from matrices and vectors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from cpbench import storage
from cpbench.cli.options import Command, force_option, symmetric_option
from cpbench.cli.problem_text import sizes_line
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import PATH, POSITIVE
from cpbench.storage.base import require_new
from cpbench.storage.half_stored import Half
from cpbench.storage.packing.pack import CONSTRAINTS, PARTS, pack_sequence, problem_from_files
from cpbench.storage.packing.parts import APPLICATIONS
from cpbench.storage.packing.remarks import remarks


@click.command(cls=Command)
@click.argument("place", metavar="[OUTPUT]", required=False, type=PATH)
@click.option("-o", "--output", "named", type=PATH, metavar="OUTPUT", help="Problem file, in place of the argument.")
@click.option("--lcp", nargs=2, type=PATH, metavar="M q", help="0 <= z _|_ Mz + q >= 0")
@click.option("--mlcp", nargs=6, type=PATH, metavar="A B C D a b", help="Au + Cv + a = 0, 0 <= v _|_ Du + Bv + b >= 0")
@click.option("--qp", nargs=2, type=PATH, metavar="Q p", help="min 1/2 z'Qz + p'z")
@click.option(
    "--game",
    nargs=2,
    type=PATH,
    metavar="A B",
    help="Bimatrix game: payoffs of the row and of the column player. solve --all lists its equilibria.",
)
@click.option(
    "--least-squares", nargs=2, type=PATH, metavar="A b", help="min 1/2 |Ax - b|^2, with --bounds or without."
)
@click.option(
    "--boxed", nargs=5, type=PATH, metavar="A b lo hi findex",
    help="Boxed LCP of ODE, DART, Bullet: Ax = b + w, lo <= x <= hi; |x_i| <= hi_i x_j where findex_i = j >= 0.",
)  # fmt: skip
@click.option("--inequality", nargs=2, type=PATH, metavar="A b", help="Az >= b, with --qp.")
@click.option("--equality", nargs=2, type=PATH, metavar="C d", help="Cz = d, with --qp.")
@click.option("--bounds", nargs=2, type=PATH, metavar="lb ub", help="lb <= z <= ub, with --qp or --least-squares.")
@click.option("--fc", nargs=3, type=PATH, metavar="W q mu", help="Frictional contact, local.")
@click.option("--gfc", nargs=5, type=PATH, metavar="M H f w mu", help="Frictional contact, global.")
@click.option("--axes", type=click.Choice(["NTT", "TTN", "NT", "TN"]), help="Order of the rows; default: normal first.")
@click.option("--name", default="", help="Name of the problem, or of the sequence; default: name of the file.")
@click.option(
    "--sequence",
    is_flag=True,
    help="Pack one problem per step, in the order that cpbench run --start previous follows.",
)
@click.option("--problems", type=PATH, metavar="PATH", help="Steps as problem files or a pack, with --sequence.")
@click.option("--dt", type=POSITIVE, help="Time step [s], with --sequence.")
@click.option(
    "--ids", type=PATH, metavar="PATH", help="Number that identifies each contact from step to step, with --sequence."
)
@click.option("--positions", type=PATH, metavar="PATH", help="Positions of contacts, nc x 3 [m], with --sequence.")
@symmetric_option
@force_option
def command(
    place: Path | None,
    named: Path | None,
    name: str,
    force: bool,
    axes: str | None,
    sequence: bool,
    symmetric: Half | None,
    **given: Any,
) -> None:
    """Make a problem file from matrices and vectors in .npy, .npz, .mtx or .csv files.

    With --sequence every PATH is a folder or a glob with one file per step (in the order of the numbers in their
    names), or an array with the steps as first dimension; data without steps are the same in all steps:

    \b
      cpbench pack scene.h5 --sequence --dt 1e-3 --fc 'W*.npz' 'q*.npy' mu.npy --ids 'ids*.npy'
      cpbench pack scene.h5 --sequence --dt 1e-3 --problems steps/ --ids ids.npy
      cpbench run scene.h5 --start previous,cold
    """
    output = place or named
    if output is None or (place and named):
        raise click.UsageError("name one file to write: cpbench pack OUTPUT ..., or -o OUTPUT")
    name = name or output.stem
    kinds = [kind for kind in (*PARTS, "problems") if given[kind]]
    if symmetric and sequence:
        raise click.UsageError("--symmetric goes with one problem, not with --sequence")
    if sequence:
        _pack_sequence(output, name, force, axes, kinds, given)
        return
    node = _formulation(kinds, axes, symmetric, given)
    require_new(output, force)
    files = dict(zip(PARTS[node], given[node], strict=True))
    for option, parts in CONSTRAINTS.items():
        files |= dict(zip(parts, given[option] or (), strict=False))
    problem = problem_from_files(node, files, axes, name, symmetric)
    storage.save(problem, output, force=force)
    print_lines([f"{output} ({problem.node}: {sizes_line(problem)})"])
    if node in ("fc", "gfc"):
        print_lines((f"remark: {remark}" for remark in remarks(problem)), err=True)


def _formulation(kinds: list[str], axes: str | None, symmetric: Half | None, given: dict[str, Any]) -> str:
    """Return the one formulation that is given; raises UsageError where the options do not go together."""
    for option in ("problems", "dt", "ids", "positions"):
        if given[option] is not None:
            raise click.UsageError(f"--{option} goes with --sequence")
    if len(kinds) != 1:
        raise click.UsageError(f"give exactly one of {', '.join(map(_option, PARTS))}")
    node = kinds[0]
    for option in (name for name in CONSTRAINTS if given[name] and node != "qp"):
        if (node, option) != ("least_squares", "bounds"):
            raise click.UsageError(f"--{option} goes with --qp, not with {_option(node)}")
    if axes is not None and node not in ("fc", "gfc"):
        raise click.UsageError(f"--axes goes with --fc and --gfc, not with {_option(node)}")
    if symmetric and node in APPLICATIONS:
        raise click.UsageError(f"--symmetric does not go with {_option(node)}, whose matrices are not symmetric")
    return node


def _option(kind: str) -> str:
    return f"--{kind.replace('_', '-')}"


def _pack_sequence(
    output: Path, name: str, force: bool, axes: str | None, kinds: list[str], given: dict[str, Any]
) -> None:
    others = [kind for kind in CONSTRAINTS if given[kind]]
    if len(kinds) != 1 or others or kinds[0] not in ("fc", "gfc", "problems"):
        raise click.UsageError("--sequence takes one of --fc, --gfc, --problems: a sequence has contact problems")
    if given["dt"] is None:
        raise click.UsageError("--sequence needs the size of a step: --dt SECONDS")
    if given["problems"] and axes is not None:
        raise click.UsageError("--axes goes with --fc and --gfc, not with --problems")
    node = kinds[0]
    files = {"problems": given["problems"]} if node == "problems" else dict(zip(PARTS[node], given[node], strict=True))
    known = {option: given[option] for option in ("ids", "positions") if given[option] is not None}
    sizes, remark = pack_sequence(output, name, given["dt"], node, files, known, axes, force=force)
    print_lines([f"{output} ({sizes})"])
    if remark:
        print_lines([f"no ids and no positions of contacts (--ids, --positions): {remark}"], err=True)
