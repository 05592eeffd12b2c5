"""Say why a solver fails on a problem, and which remedy works."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from cpbench.api.problems import load
from cpbench.api.results import is_results_file
from cpbench.bench.planning.plan import Limits
from cpbench.cli.options import ListOption, format_option, memory_option, quiet_option, threads_option
from cpbench.cli.progress import Steps
from cpbench.cli.terminal import fitted, print_lines
from cpbench.cli.types import ADDRESS, DURATION, POSITIVE
from cpbench.generators.collection import address_text
from cpbench_lab.diagnosing import MINUTES, SECONDS, diagnose_apart, trial_of_row


@click.command()
@click.argument("problem", metavar="PROBLEM|RESULTS", type=ADDRESS)
@click.option("-s", "--solver", required=True, metavar="NAME[opt=value]", help="Solver; with RESULTS its label there.")
@click.option("--pair", metavar="PROBLEM", help="Problem of RESULTS, by its name there.")
@click.option("--via", cls=ListOption, metavar="CONVERSION", help="Conversion to go through. Repeatable.")
@click.option(
    "--tolerance", "-t", type=POSITIVE, help="Largest error of an answer that solves the problem; default: 1e-6."
)
@click.option("--timeout", type=DURATION, help=f"Wall-clock limit of every solve that is tried; default: {SECONDS:g}s.")
@click.option(
    "--minutes",
    type=POSITIVE,
    default=MINUTES,
    show_default=True,
    help="Time of it all; what is found by then is printed.",
)
@memory_option
@threads_option
@format_option
@quiet_option
def command(
    problem: str,
    solver: str,
    pair: str | None,
    via: tuple[str, ...],
    tolerance: float | None,
    timeout: float | None,
    minutes: float,
    memory: int,
    threads: int,
    file_format: str | None,
    quiet: bool,
) -> None:
    """Say why a solver fails on a problem: the first confirmed cause, and the remedies that were tried.

    The pair is solved again. A property is a cause if it is proved to be, or if the same solver succeeds on the nearest
    problem without it; else it is suspected. A right answer may have other complaints: what the solver claims of it, or
    its time. Remedies are tried, and their answers measured on the original problem: limits, tolerance, units, start,
    solvers of other methods and formulations. With RESULTS, options, route, tolerance and limit are
    those of the row. `cpbench graph PROBLEM --explain` says why a problem cannot reach a formulation. The exit code is
    1 when no remedy works.
    """
    with Steps(quiet) as steps:
        from cpbench_lab.diagnosis.attempts import SolverTrial

        steps.say(f"reading {problem}")
        if is_results_file(problem):
            if pair is None or via:
                raise click.UsageError("with RESULTS give --pair PROBLEM, and no --via: the row has its route")
            trial = trial_of_row(Path(problem), pair, solver, tolerance=tolerance, seconds=timeout)
            address = "PROBLEM"
        else:
            if pair is not None:
                raise click.UsageError(f"--pair goes with a results file, {problem} is none")
            asked = load(problem, format=file_format)
            limit = timeout or SECONDS
            trial = SolverTrial(problem=asked, solver=solver, tolerance=tolerance or 1e-6, seconds=limit, via=via)
            address = address_text(problem)
        limits = Limits(trial.seconds, memory, threads)
        found = diagnose_apart(trial, limits, minutes=minutes, say=steps.say, address=address)
    print_lines(fitted(found.lines()))
    if found.fails and found.remedy is None:
        sys.exit(1)
