"""`cpbench sweep`."""

from __future__ import annotations

import json
import sys

import click

from cpbench.api import sweeping
from cpbench.api.problems import load
from cpbench.cli.options import Command, format_option, json_option, tolerance_option
from cpbench.cli.terminal import print_lines, table
from cpbench.cli.types import ADDRESS, DURATION


@click.command(cls=Command)
@click.argument("problem", type=ADDRESS)
@click.option(
    "--over",
    required=True,
    metavar="NAME=VALUES",
    help="Parameter and its values: mu=0.1:2.0:0.1 (with the last), or mu=0.1|0.5. mu and mu_r set all contacts.",
)
@tolerance_option
@click.option(
    "--timeout", type=DURATION, default="10s", show_default=True, help="Wall-clock limit that each solver is told."
)
@json_option
@format_option
def command(problem: str, over: str, tolerance: float, timeout: float, as_json: bool, file_format: str | None) -> None:
    """Solve a problem for several values of a parameter, and print a line for each.

    The parameter is one of the problem's expressions, or the coefficient of friction of all its contacts. The automatic
    choice solves them, in this process. The exit code is 1 unless all answers meet the tolerance.
    """
    loaded = load(problem, format=file_format)
    name, values = sweeping.over(over)
    head = sweeping.head(loaded, name)
    answers = list(sweeping.sweep(loaded, name, values, tolerance=tolerance, seconds=timeout))
    rows = [sweeping.cells(answer) for answer in answers]
    if as_json:
        click.echo(json.dumps([dict(zip(head, row, strict=True)) for row in rows]))
    else:
        print_lines(table([head, *rows]))
    if not all(answer.solution for answer in answers):
        sys.exit(1)
