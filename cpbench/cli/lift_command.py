"""Carry an answer to a converted problem back to its source."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench import graph, storage
from cpbench.cli.options import Command, force_option
from cpbench.cli.terminal import print_lines
from cpbench.errors import CpbenchError, FormatError
from cpbench.storage.answers import save_vector
from cpbench.storage.base import require_new


@click.command(cls=Command)
@click.argument("solution", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path),
    help="Output file of the answer: .h5, .npy or .csv.",
)
@click.option("--problem", metavar="FILE", help="Converted problem, where SOLUTION is a bare vector or answer.")
@click.option("--steps", type=click.IntRange(min=1), help="Number of conversions to undo, from the last; default: all.")
@force_option
def command(solution: Path, output: Path, problem: str | None, steps: int | None, force: bool) -> None:
    """Carry an answer to a converted problem back to its source.

    SOLUTION is a file with a converted problem and its answer, as `cpbench solve -o FILE.h5` writes it, or an answer
    (.h5, .npy, .npz, .csv) to the converted problem named by --problem.
    """
    require_new(output, force)
    converted = storage.load(problem or str(solution))
    if not converted.provenance:
        raise CpbenchError(f"{problem or solution}: was not converted by cpbench, there is nothing to lift")
    if problem is None:
        stored = storage.solution(solution)
        if stored is None:
            raise FormatError(
                solution, "solution", "is missing; give the answer as SOLUTION and its problem by --problem"
            )
        point = stored[0]
    else:
        point = storage.load_answer(solution, converted)
    undone = converted.provenance if steps is None else converted.provenance[-steps:]
    lifted = graph.lift(converted, point, steps)
    first = undone[0]
    if not save_vector(lifted, output, force=force):
        name = {"name": converted.name}
        storage.save_point(output, lifted, node=first.source_node, fingerprint=first.source, attrs=name, force=force)
    for remark in graph.remarks(converted, point, steps):
        print_lines([f"note: {remark}"], err=True)
    edges = " > ".join(s.conversion for s in undone)
    print_lines([f"{output}: answer to the {first.source_node} problem before {edges}"])
