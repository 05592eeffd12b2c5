"""`cpbench lift`."""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np

from cpbench import graph, storage
from cpbench.cli.options import force_option
from cpbench.errors import CpbenchError, FormatError


@click.command()
@click.argument("solution", type=click.Path(path_type=Path))
@click.option("-o", "--output", required=True, type=click.Path(path_type=Path), help="Answer file: .h5, .npy or .csv.")
@click.option("--problem", metavar="FILE", help="The converted problem, when SOLUTION is a bare vector or answer.")
@click.option("--steps", type=click.IntRange(min=1), help="Undo only the last STEPS conversions (default: all).")
@force_option
def command(solution: Path, output: Path, problem: str | None, steps: int | None, force: bool) -> None:
    """Carry an answer to a converted problem back to its source.

    SOLUTION is a converted problem with its answer in /solution, or an answer (.h5, .npy, .npz, .csv) to the
    converted problem named by --problem.
    """
    converted = storage.load(problem or str(solution))
    if not converted.provenance:
        raise CpbenchError(f"{problem or solution}: was not converted by cpbench, there is nothing to lift")
    if problem is None:
        found = storage.solution(solution)
        if found is None:
            raise FormatError(
                solution, "solution", "is missing; give the answer as SOLUTION and its problem by --problem"
            )
        point = found[0]
    else:
        point = storage.load_answer(solution, converted)
    undone = converted.provenance if steps is None else converted.provenance[-steps:]
    lifted = graph.lift(converted, point, steps)
    first = undone[0]
    write_answer(lifted, output, node=first.source_node, fingerprint=first.source, name=converted.name, force=force)
    edges = " > ".join(s.conversion for s in undone)
    click.echo(f"{output}: answer to the {first.source_node} problem before {edges}")


def write_answer(point: object, output: Path, *, node: str, fingerprint: str, name: str, force: bool) -> None:
    """A lifted point as .npy or .csv (parts one after the other) or as an HDF5 answer file."""
    if output.exists() and not force:
        raise FormatError(output, "", "exists already; use --force to replace it")
    parts = point.arrays()  # type: ignore[attr-defined]
    vector = np.concatenate(list(parts.values()))
    if output.suffix == ".npy":
        with output.open("wb") as file:
            np.save(file, vector, allow_pickle=False)
    elif output.suffix in (".csv", ".txt"):
        np.savetxt(output, vector, fmt="%.17g")
    else:
        storage.save_point(output, point, node=node, fingerprint=fingerprint, attrs={"name": name}, force=force)
