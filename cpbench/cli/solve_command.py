"""Solve one problem, and print the answer and what it is worth; or all solutions of a small one."""

from __future__ import annotations

import json
import os
import sys
from typing import Any

import click

from cpbench.cli.options import (
    force_option,
    format_option,
    json_option,
    limit_options,
    tolerance_option,
    via_option,
)
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import PATH
from cpbench.foundation.child_processes import THREAD_VARIABLES
from cpbench.foundation.imports import uncollected

AUTO = "auto"


@click.command()
@click.argument("address", metavar="PROBLEM")
@click.option(
    "-s",
    "--solver",
    default=AUTO,
    show_default=True,
    metavar="NAME[opt=value]",
    help="Solver (cpbench list solvers); auto: cpbench chooses among its own, as cpbench.solve does.",
)
@via_option
@click.option(
    "--routes", type=click.Choice(["exact", "all"]), default="exact", show_default=True, help="Conversions to consider."
)
@click.option(
    "--start",
    default="cold",
    show_default=True,
    metavar="POLICY",
    help="Start of the solver: cold, file or file:K (the file's guesses).",
)
@tolerance_option
@limit_options
@click.option("-o", "--output", type=PATH, help="Output file of the answer (.h5, .npy, .csv).")
@click.option(
    "--all", "every", is_flag=True, help="List all solutions of a small LCP or MLCP, or of what is equivalent to one."
)
@click.option("-v", "--verbose", is_flag=True, help="Show all numbers of the answer, its route, times and measures.")
@json_option
@format_option
@force_option
def command(timeout: float, memory: int, threads: int, as_json: bool, file_format: str | None, **given: Any) -> None:
    """Solve one problem, and print the answer and what it is worth.

    The answer is measured on the problem itself, whatever the solver says of it. Of a problem with contacts a table
    tells what each of them does. The solver runs in a separate process, which is stopped at the limits. With --all
    the command lists all solutions instead, found in exact arithmetic.

    The exit code is 1 unless the answer is verified, or it is proved that there is none, so that `solve ... &&
    convert ... --lift` lifts no wrong answer. The answer is written in either case.
    """
    if given["every"] and (given["solver"] != AUTO or given["via"] or given["start"] != "cold"):
        raise click.UsageError("--all looks at every complementary basis: leave out -s, --via and --start")
    for variable in THREAD_VARIABLES:  # before what reads them is imported
        os.environ[variable] = str(threads)
    with uncollected():
        from cpbench.bench.planning.plan import Limits
        from cpbench.cli.solve_process import SolveRequest, solve_alone
    request = SolveRequest(**given, limits=Limits(timeout, memory, threads, repeats=1), format=file_format)
    reply = solve_alone(request)
    for line in [json.dumps(reply["record"])] if as_json else reply["lines"]:
        click.echo(line)
    if request.output is not None and not reply["written"]:
        click.echo("no answer to write", err=True)
        sys.exit(1)
    if request.output is not None:
        print_lines([f"answer: {request.output}"], err=as_json)
    if not reply["good"]:
        sys.exit(1)
