"""Search for problems on which a solver makes a false claim, crashes or is slow, and another does not."""

from __future__ import annotations

import time
from pathlib import Path

import click

from cpbench.bench.planning.plan import Limits
from cpbench.cli.options import memory_option, quiet_option, seed_option, tolerance_option
from cpbench.cli.terminal import print_lines, table
from cpbench.cli.types import DURATION, FOLDER, POSITIVE
from cpbench.foundation.text import counted
from cpbench_lab.reduction.hunting.hunt import HuntState, hunt

EVERY = 10.0
"""Seconds between two lines of progress."""


@click.command()
@click.option("-s", "--solver", required=True, metavar="NAME[opt=value]", help="Solver whose failures are sought.")
@click.option("--against", required=True, metavar="NAME[opt=value]", help="Solver that solves these problems.")
@click.option("-o", "--output", type=FOLDER, required=True, help="Output folder, a new one.")
@click.option("--minutes", type=POSITIVE, default=10.0, show_default=True, help="Time of search and reduction.")
@click.option("--node", default="", metavar="NAME", help="Formulation of the problems; default: that of the solver.")
@click.option("--timeout", type=DURATION, default="2s", show_default=True, help="Limit of each solve.")
@seed_option("Seed of the problems.")
@tolerance_option
@memory_option
@quiet_option
def command(
    solver: str,
    against: str,
    output: Path,
    minutes: float,
    node: str,
    timeout: float,
    seed: int,
    tolerance: float,
    memory: int,
    quiet: bool,
) -> None:
    """Search for problems on which a solver makes a false claim, crashes or takes a hundred times as long, and another
    does not.

    Built-in problems are changed a little, again and again, spread over size, conditioning, rank, units, friction and
    degeneracy. The first failure of each kind is reduced and certified as by `cpbench reduce`. The exit code is 1 when
    there is a failure.
    """
    last = time.monotonic()

    def on_event(search: HuntState) -> None:
        nonlocal last
        if not quiet and time.monotonic() - last > EVERY:
            last = time.monotonic()
            found = counted(len(search.finds), "kind of failure", "kinds of failure")
            click.echo(f"{counted(search.tried, 'problem')}, {counted(len(search.best), 'cell')}, {found}", err=True)

    search, shown = hunt(
        solver,
        against,
        output,
        seconds=60 * minutes,
        seed=seed,
        limits=Limits(timeout, memory, repeats=1),
        tolerance=tolerance,
        node=node,
        on_event=on_event,
    )
    click.echo(f"{counted(search.tried, 'problem')} of {counted(len(search.best), 'cell')}, seed {seed}")
    rows = [("failure", "found", "reduced to", "digits", "certified", "what it said")]
    for one in shown:
        rows.append(
            (one.find.kind, f"{one.find.times}×", one.sizes, str(one.digits or ""), one.level, one.find.words)
        )  # fmt: skip
    print_lines(table(rows) if shown else ["no failure found"])
    if shown:
        raise SystemExit(1)
