"""Solve a problem for several values of a parameter, such as the coefficient of friction."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from cpbench import storage
from cpbench.api.problems import load as load_problem
from cpbench.cli.options import format_option, json_option, tolerance_option
from cpbench.cli.terminal import print_lines, table
from cpbench.cli.types import ADDRESS, DURATION, PATH
from cpbench.formulations.base import Problem
from cpbench_lab import sweeping
from cpbench_lab.hold_limits import hold_limit


@click.command()
@click.argument("problem", type=ADDRESS)
@click.option(
    "--over",
    metavar="NAME=VALUES",
    help="Parameter and its values: mu=0.1:2.0:0.1 (with the last), or mu=0.1|0.5. mu and mu_r set all contacts.",
)
@click.option("--bisect", is_flag=True, help="Find the least friction (--over mu) or largest load (--load) that holds.")
@click.option("--load", type=PATH, metavar="VECTOR", help="With --bisect: what a factor multiplies, added to f or q.")
@tolerance_option
@click.option("--timeout", type=DURATION, default="10s", show_default=True, help="Wall-clock limit of each solver.")
@json_option
@format_option
def command(
    problem: str,
    over: str | None,
    bisect: bool,
    load: Path | None,
    tolerance: float,
    timeout: float,
    as_json: bool,
    file_format: str | None,
) -> None:
    """Solve a problem for several values of a parameter, and print a line for each.

    The parameter is one of the problem's expressions, or the coefficient of friction of all its contacts. The automatic
    choice solves them, in this process. The exit code is 1 unless all answers meet the tolerance.

    With --bisect the command finds where bodies at rest begin to move: a cone program says at each value whether
    forces in the cones of friction hold the load of an fc or gfc, and at the ends of the last interval both answers are
    proved in rational arithmetic where that succeeds. The tolerance is the width of that interval, over its upper end;
    the exit code is 1 where it is not reached. Above 1 % the limit is undecided. That any friction or any load holds,
    that none does, or that rounding alone decides, are answers.

    \b
      cpbench sweep scene.h5 --over mu=0.1:2.0:0.1
      cpbench sweep scene.h5 --over mu --bisect
      cpbench sweep scene.h5 --load push.npy --bisect
    """
    if bisect != (over == "mu" or load is not None) or (over is not None and load is not None):
        raise click.UsageError("--bisect goes with --over mu, without values, or with --load VECTOR, and they with it")
    if over is None and load is None:
        raise click.UsageError("give --over NAME=VALUES, or --bisect")
    loaded = load_problem(problem, format=file_format)
    if over is None or bisect:
        _bisect(loaded, load, tolerance, as_json)
        return
    name, values = sweeping.over(over)
    head = sweeping.head(loaded, name)
    answers = list(sweeping.sweep(loaded, name, values, tolerance=tolerance, seconds=timeout))
    rows = [sweeping.cells(answer) for answer in answers]
    if as_json:
        click.echo(json.dumps([dict(zip(head, row, strict=True)) for row in rows]))
    else:
        print_lines([*table([head, *rows]), *sweeping.remarks(name, answers)])
    if not all(answer.solution for answer in answers):
        sys.exit(1)


def _bisect(problem: Problem, load: Path | None, width: float, as_json: bool) -> None:
    limit = hold_limit(problem, None if load is None else storage.read_vector(load), width)
    if as_json:
        click.echo(json.dumps(limit.record()))
    else:
        print_lines(limit.lines(f"{problem.name} ({problem.node})"))
    if not limit.narrow:
        sys.exit(1)
