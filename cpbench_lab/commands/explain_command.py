"""Say why a solver fails on a problem, and which remedy works."""

from __future__ import annotations

import sys

import click

from cpbench.api.problems import load
from cpbench.bench.planning.plan import Limits
from cpbench.cli.options import ListOption, format_option, memory_option, quiet_option, threads_option, tolerance_option
from cpbench.cli.progress import Steps
from cpbench.cli.terminal import fitted, print_lines
from cpbench.cli.types import ADDRESS, DURATION, POSITIVE
from cpbench.generators.collection import address_text
from cpbench_lab.diagnosing import MINUTES, SECONDS, diagnose_apart


@click.command()
@click.argument("problem", type=ADDRESS)
@click.option("-s", "--solver", required=True, metavar="NAME[opt=value]", help="Solver (cpbench list solvers).")
@click.option("--via", cls=ListOption, metavar="CONVERSION", help="Conversion to go through. Repeatable.")
@tolerance_option
@click.option(
    "--timeout",
    type=DURATION,
    default=f"{SECONDS:g}s",
    show_default=True,
    help="Wall-clock limit of every solve that is tried.",
)
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
    via: tuple[str, ...],
    tolerance: float,
    timeout: float,
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
    solvers of other methods and formulations. `cpbench graph PROBLEM --explain` says why a problem cannot reach a
    formulation. The exit code is 1 when no remedy works.
    """
    with Steps(quiet) as steps:
        from cpbench_lab.diagnosis.attempts import SolverTrial

        steps.say(f"reading {problem}")
        asked = load(problem, format=file_format)
        trial = SolverTrial(problem=asked, solver=solver, tolerance=tolerance, seconds=timeout, via=via)
        limits = Limits(timeout, memory, threads)
        found = diagnose_apart(trial, limits, minutes=minutes, say=steps.say, address=address_text(problem))
    print_lines(fitted(found.lines()))
    if found.fails and found.remedy is None:
        sys.exit(1)
