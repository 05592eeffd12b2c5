"""`cpbench explain`."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from cpbench.api.diagnosing import SECONDS, diagnose_apart, trial_of, trial_of_row
from cpbench.api.problems import load
from cpbench.api.results import is_results_file
from cpbench.bench.planning.plan import Limits
from cpbench.cli.options import Command, ListOption, format_option, memory_option, threads_option
from cpbench.cli.terminal import fitted, print_lines
from cpbench.cli.types import ADDRESS, DURATION, POSITIVE


@click.command(cls=Command)
@click.argument("problem", metavar="PROBLEM|RESULTS", type=ADDRESS)
@click.option("-s", "--solver", required=True, metavar="NAME[opt=value]", help="Solver; with RESULTS its label there.")
@click.option("--pair", metavar="PROBLEM", help="Problem of RESULTS, by its name there.")
@click.option("--via", cls=ListOption, metavar="CONVERSION", help="Conversion to go through. Repeatable.")
@click.option(
    "--tolerance", "-t", type=POSITIVE, help="Largest error of an answer that solves the problem; default: 1e-6."
)
@click.option("--timeout", type=DURATION, help=f"Wall-clock limit of every solve that is tried; default: {SECONDS:g}s.")
@memory_option
@threads_option
@format_option
def command(
    problem: str,
    solver: str,
    pair: str | None,
    via: tuple[str, ...],
    tolerance: float | None,
    timeout: float | None,
    memory: int,
    threads: int,
    file_format: str | None,
) -> None:
    """Say why a solver fails on a problem: the first cause, its evidence, and the remedies that were tried.

    The pair is solved again. To check a cause, the same solver solves the nearest problem without it. Remedies (limits,
    tolerance, units, start, other solvers) are tried until one works; their answers are measured on the original
    problem. With RESULTS, options, route, tolerance and limit are those of the row. `cpbench route PROBLEM --explain`
    says why a problem cannot reach a formulation. The exit code is 1 when no remedy works.
    """
    if is_results_file(problem):
        if pair is None or via:
            raise click.UsageError("with RESULTS give --pair PROBLEM, and no --via: the row has its route")
        trial = trial_of_row(Path(problem), pair, solver, tolerance=tolerance, seconds=timeout)
    else:
        if pair is not None:
            raise click.UsageError(f"--pair goes with a results file, {problem} is none")
        asked = load(problem, format=file_format)
        trial = trial_of(asked, solver, tolerance=tolerance or 1e-6, seconds=timeout or SECONDS, via=via)
    found = diagnose_apart(trial, Limits(trial.seconds, memory, threads))
    print_lines(fitted(found.lines()))
    if found.fails and found.remedy is None:
        sys.exit(1)
