"""Reduce a problem on which a solver fails to the smallest and simplest that still fails."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.bench.planning.plan import Limits
from cpbench.cli.options import memory_option, quiet_option, tolerance_option, via_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import DURATION, FOLDER, POSITIVE
from cpbench.foundation.text import counted
from cpbench.generators.collection import address_text
from cpbench_lab.reduction.cases import case_of, reduce_case
from cpbench_lab.reduction.predicate import parse_predicate
from cpbench_lab.reduction.reduce import data_size


@click.command()
@click.argument("problem", metavar="PROBLEM")
@click.option("-s", "--solver", required=True, metavar="NAME[opt=value]", help="Solver that fails.")
@click.option(
    "--while",
    "predicate",
    metavar="FAILURE",
    help="Failure to keep: wrong, crash, timeout, ..., slower:100[:OTHER], disagrees[:OTHER].",
)
@click.option("-o", "--output", type=FOLDER, required=True, help="Output folder, a new one.")
@click.option("--minutes", type=POSITIVE, default=1.0, show_default=True, help="Time of the reduction.")
@click.option("--timeout", type=DURATION, default="2s", show_default=True, help="Limit of each solve.")
@via_option
@tolerance_option
@memory_option
@quiet_option
def command(
    problem: str,
    solver: str,
    predicate: str | None,
    output: Path,
    minutes: float,
    timeout: float,
    via: tuple[str, ...],
    tolerance: float,
    memory: int,
    quiet: bool,
) -> None:
    """Reduce a problem on which a solver fails to the smallest and simplest that still fails.

    The command removes contacts, bodies, unknowns and rows, and rounds numbers, as long as the solver fails as before;
    each candidate is solved in a separate process. The folder then has the problem, a picture and a report for an
    issue: `cpbench reduce scene.h5 -s nsgs --while timeout -o nsgs-hangs`.
    """
    if predicate is None:
        raise click.UsageError("say what has to stay: --while wrong (or crash, timeout, ...)")
    limits = Limits(timeout, memory, repeats=1)
    case = case_of(problem, solver, parse_predicate(predicate), limits, tolerance=tolerance, via=via)

    def progress(candidate: object, tried: int) -> None:
        if not quiet:
            print_lines([f"{counted(tried, 'solve')}: {candidate}"], err=True)

    reduced, written = reduce_case(case, output, 60 * minutes, progress)
    click.echo(
        f"{address_text(case.address)}: {case.asked.predicate} with {data_size(reduced.problem)} numbers of "
        f"{data_size(reduced.source)}, {counted(reduced.tried, 'solve')}"
    )
    if not reduced.complete:
        click.echo("  not to the end: the time was over; --minutes gives it longer")
    for path in written:
        print_lines([f"  {path}"])
