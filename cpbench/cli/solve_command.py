"""`cpbench solve`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from cpbench.api.solve_apart import solve_apart
from cpbench.bench.events import Compiling, Event
from cpbench.bench.planning.plan import Limits
from cpbench.cli.options import (
    Command,
    facets_option,
    force_option,
    format_option,
    json_option,
    limit_options,
    require_with_via,
    tolerance_option,
    via_option,
)
from cpbench.cli.progress import compiling
from cpbench.cli.terminal import print_lines
from cpbench.cli.types import ADDRESS, PATH
from cpbench.storage.base import require_new


@click.command(cls=Command)
@click.argument("problem", type=ADDRESS)
@click.option("-s", "--solver", required=True, metavar="NAME[opt=value]", help="Solver (cpbench list solvers).")
@via_option
@facets_option
@click.option(
    "--routes", type=click.Choice(["exact", "all"]), default="exact", show_default=True, help="Conversions to consider."
)
@click.option(
    "--start",
    default="cold",
    show_default=True,
    metavar="POLICY",
    help="Start of the solver: cold, file or file:K (the file's guesses), perturbed:σ (near its solution).",
)
@tolerance_option
@limit_options
@click.option("-o", "--output", type=PATH, help="Output file of the answer (.h5, .npy, .csv).")
@json_option
@format_option
@force_option
def command(
    problem: str,
    solver: str,
    via: tuple[str, ...],
    facets: int,
    routes: str,
    start: str,
    tolerance: float,
    timeout: float,
    memory: int,
    threads: int,
    output: Path | None,
    as_json: bool,
    file_format: str | None,
    force: bool,
) -> None:
    """Solve one problem by one solver, in a process of its own, and say what the answer is worth.

    The exit code is 1 unless the answer is verified, or it is proved that there is none, so that `solve ... && lift
    ...` lifts no wrong answer. The answer is written in either case.
    """
    if output is not None:
        require_new(output, force)
    require_with_via(via)
    solved = solve_apart(
        problem,
        solver,
        via=via,
        facets=facets,
        routes=routes,
        start=start,
        tolerance=tolerance,
        limits=Limits(timeout, memory, threads, repeats=1),
        format=file_format,
        on_event=_on_event,
    )
    print_lines([json.dumps(solved.record())] if as_json else solved.lines())
    if output is not None and solved.outcome.answer is None:
        click.echo("no answer to write", err=True)
        sys.exit(1)
    if output is not None:
        solved.save(output, format=file_format, force=force)
        click.echo(f"answer: {output}", err=as_json)
    if not solved:
        sys.exit(1)


def _on_event(event: Event) -> None:
    if isinstance(event, Compiling):
        click.echo(compiling(event.solver), err=True)
