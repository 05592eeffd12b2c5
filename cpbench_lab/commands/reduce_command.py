"""Reduce a problem on which a solver fails to the smallest and simplest that still fails."""

from __future__ import annotations

from pathlib import Path

import click

from cpbench.api.results import is_results_file
from cpbench.bench.planning.plan import Limits
from cpbench.cli.options import memory_option, quiet_option, tolerance_option, via_option
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import DURATION, FOLDER, POSITIVE
from cpbench.errors import CpbenchError
from cpbench.foundation.text import counted
from cpbench.generators.collection import address_text
from cpbench_lab.reduction.cases import case_of, case_of_row, reduce_case
from cpbench_lab.reduction.predicate import parse_predicate
from cpbench_lab.reduction.reduce import data_size


@click.command()
@click.argument("source", metavar="PROBLEM|RESULTS")
@click.option("-s", "--solver", required=True, metavar="NAME[opt=value]", help="Solver that fails; a label of RESULTS.")
@click.option("--pair", metavar="PROBLEM", help="Problem of RESULTS on which it fails.")
@click.option(
    "--while",
    "predicate",
    metavar="FAILURE",
    help="Failure to keep: wrong, crash, timeout, ..., slower:100[:OTHER], disagrees[:OTHER]. Of a row: its status.",
)
@click.option("-o", "--output", type=FOLDER, required=True, help="Output folder, a new one.")
@click.option("--minutes", type=POSITIVE, default=1.0, show_default=True, help="Time of the reduction.")
@click.option("--timeout", type=DURATION, default="2s", show_default=True, help="Limit of each solve.")
@via_option
@tolerance_option
@memory_option
@quiet_option
def command(
    source: str,
    solver: str,
    pair: str | None,
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
    issue.

    \b
    cpbench reduce scene.h5 -s nsgs --while timeout -o nsgs-hangs
    cpbench reduce results.sqlite --pair scene -s highs -o highs-lies
    """
    limits = Limits(timeout, memory, repeats=1)
    if is_results_file(source):
        if pair is None:
            raise click.UsageError("name the problem of the results: --pair PROBLEM")
        case = case_of_row(Path(source), pair, solver, predicate, limits)
    elif pair is not None:
        raise CpbenchError(f"--pair goes with a results file, which {source} is not")
    elif predicate is None:
        raise click.UsageError("say what has to stay: --while wrong (or crash, timeout, ...)")
    else:
        case = case_of(source, solver, parse_predicate(predicate), limits, tolerance=tolerance, via=via)

    def progress(problem: object, tried: int) -> None:
        if not quiet:
            print_lines([f"{counted(tried, 'solve')}: {problem}"], err=True)

    reduced, written = reduce_case(case, output, 60 * minutes, progress)
    click.echo(
        f"{address_text(case.address)}: {case.asked.predicate} with {data_size(reduced.problem)} numbers of "
        f"{data_size(reduced.source)}, {counted(reduced.tried, 'solve')}"
    )
    if not reduced.complete:
        click.echo("  not to the end: the time was over; --minutes gives it longer")
    for path in written:
        print_lines([f"  {path}"])
