"""Starts the forkserver of a command that solves, before the command itself is imported: both import side by side.

What it needs to know is read off the arguments as they stand. Where a file or a plugin may say otherwise the command
starts it, later.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator, Sequence

SOLVING = ("run", "solve")
ELSEWHERE = ("-h", "--help", "--plugin", "--dask", "--cluster")
"""Options with which nothing is solved here, or by what is known only when they are read."""
PLAN, NO_PLAN = "cpbench.toml", "none"
FEW = 4
"""The most solvers of which each loads what it needs, in place of all that there is once for all."""


def begin(arguments: Sequence[str]) -> None:
    """Start it for a command and its arguments, unless there is nothing to solve or that is not sure."""
    command, *rest = arguments
    if command not in SOLVING or any(_values(rest, *ELSEWHERE)):
        return
    plans = list(_values(rest, "--plan")) or ([PLAN] if command == "run" and os.path.exists(PLAN) else [])
    threads = next(_values(rest, "--threads"), "1")
    names = [name for given in _values(rest, "-s", "--solver") for name in given.split(",")]
    if any(plan != NO_PLAN for plan in plans) or not threads.isdecimal() or any("@" in name for name in names):
        return
    from cpbench.bench.processes import launch

    several = (
        not names or len(names) > FEW or any({*name.partition("[")[0]} & {*"*?"} or name == "all" for name in names)
    )
    launch.begin(int(threads), few=command == "solve" or not several)


def _values(arguments: Sequence[str], *names: str) -> Iterator[str]:
    """Yield what is given to these options, `--name value` or `--name=value`; what follows a flag is as good."""
    for this, following in itertools.pairwise([*arguments, "-"]):
        name, equals, value = this.partition("=")
        if name in names:
            yield value if equals else following
