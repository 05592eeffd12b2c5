"""Search for problems on which a solver makes a false claim, crashes or is slow, and another does not."""

from __future__ import annotations

import shlex
import time
from pathlib import Path

import click

from cpbench.bench.planning.plan import Limits
from cpbench.cli.options import memory_option, quiet_option, seed_option, tolerance_option
from cpbench.cli.terminal import print_lines, table
from cpbench.cli.types import DURATION, FOLDER, POSITIVE
from cpbench.foundation.text import counted
from cpbench_lab.reduction.hunting.hunt import FACTOR, HuntState, hunt
from cpbench_lab.reduction.predicate import SLOWER

EVERY = 10.0
"""Seconds between two lines of progress."""


@click.command()
@click.option("-s", "--solver", required=True, metavar="NAME[opt=value]", help="Solver whose failures are sought.")
@click.option("--against", required=True, metavar="NAME[opt=value]", help="Solver that solves these problems.")
@click.option("-o", "--output", type=FOLDER, required=True, help="Output folder, a new one.")
@click.option("--minutes", type=POSITIVE, default=10.0, show_default=True, help="Time of the search.")
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
    timeout: float,
    seed: int,
    tolerance: float,
    memory: int,
    quiet: bool,
) -> None:
    """Search for problems on which a solver makes a false claim, crashes or takes a hundred times as long, and another
    does not.

    Built-in problems are changed a little, again and again, most often those on which the solver came nearest to
    failing. Of each kind of failure the smallest problem is kept, for `cpbench reduce`. The exit code is 1 when
    there is a failure.
    """
    last = time.monotonic()

    def on_event(search: HuntState) -> None:
        nonlocal last
        if not quiet and time.monotonic() - last > EVERY:
            last = time.monotonic()
            found = counted(len(search.finds), "kind of failure", "kinds of failure")
            click.echo(f"{counted(search.tried, 'problem')}, {found}", err=True)

    search = hunt(
        solver,
        against,
        output,
        seconds=60 * minutes,
        seed=seed,
        limits=Limits(timeout, memory, repeats=1),
        tolerance=tolerance,
        on_event=on_event,
    )
    click.echo(f"{counted(search.tried, 'problem')}, seed {seed}")
    if not search.finds:
        print_lines(["no failure found"])
        return
    finds = list(search.finds.values())
    rows = [(one.kind, f"{one.times}×", str(one.path), one.words) for one in finds]
    print_lines(table([("failure", "found", "problem", "what it said"), *rows]))
    first = finds[0]
    name, like = f"-s {shlex.quote(solver)}", f"--while {first.kind}"
    factor = f":{FACTOR:g}:{against}" if first.kind == SLOWER else ""
    print_lines([f"next: cpbench reduce {first.path} {name} {like}{factor} -o {first.path.with_suffix('')}"])
    raise SystemExit(1)
