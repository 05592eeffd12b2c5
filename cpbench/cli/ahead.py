"""Starts the processes of a command that solves, before the command itself is imported: both import side by side.

What it needs to know is read off the arguments as they stand. Where a file or a plugin may say otherwise the command
starts them, later.
"""

from __future__ import annotations

import itertools
import os
import sys
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from cpbench.foundation.extensions import NATIVE

if TYPE_CHECKING:
    from cpbench.bench.processes.supervised import Supervised

SOLVING = ("run", "solve")
ELSEWHERE = ("-h", "--help", "--plugin", "--cluster")
"""Options with which nothing is solved here, or by what is known only when they are read."""
PLAN, NO_PLAN = "cpbench.toml", "none"
AUTO = "auto"
SOLVE_CODE = (
    "from cpbench.foundation.imports import uncollected\n"
    "with uncollected():\n    from cpbench.api.solve_process import main\n"
    "main()"
)
"""Program of the process in which `cpbench solve` solves by a solver of cpbench."""
_solving: list[Supervised] = []
"""That process, where it was begun and nothing has asked for it yet."""


def begin(arguments: Sequence[str]) -> None:
    """Start them for a command and its arguments, unless there is nothing to solve or that is not sure."""
    command, *rest = arguments
    if command not in SOLVING or any(_values(rest, *ELSEWHERE)):
        return
    plans = list(_values(rest, "--plan")) or ([PLAN] if command == "run" and os.path.exists(PLAN) else [])
    threads = next(_values(rest, "--threads"), "1")
    names = [name for given in _values(rest, "-s", "--solver") for name in given.split(",")]
    if any(plan != NO_PLAN for plan in plans) or not threads.isdecimal() or any("@" in name for name in names):
        return
    if command == "solve" and own_process(next(iter(names), AUTO)):
        begin_solving(int(threads))
        return
    from cpbench.bench.processes import launch

    launch.begin(int(threads))


def own_process(solver: str) -> bool:
    """Return whether a solver of cpbench solves in one process that is limited by the system, on this one.

    Others run in processes with more isolation. Only the text of modules is looked at: nothing is imported.
    """
    if sys.platform != "linux":
        return False
    name = solver.partition("[")[0]
    place = find_spec(NATIVE)
    folders = list(place.submodule_search_locations or ()) if place is not None else []
    modules = (path for folder in folders for path in Path(folder).glob("*/*.py"))
    return place is not None and (name == AUTO or any(f'"{name}"' in path.read_text("utf-8") for path in modules))


def begin_solving(threads: int) -> None:
    """Start the process in which `cpbench solve` solves, unless it was."""
    from cpbench.bench.processes.supervised import Supervised

    if not _solving:
        _solving.append(Supervised(SOLVE_CODE, threads))


def solving(threads: int) -> Supervised:
    """Return that process, begun or started now."""
    begin_solving(threads)
    return _solving.pop()


def end() -> None:
    """End that process where no command took it."""
    while _solving:
        _solving.pop().close()


def _values(arguments: Sequence[str], *names: str) -> Iterator[str]:
    """Yield what is given to these options, `--name value` or `--name=value`; what follows a flag is as good."""
    for this, following in itertools.pairwise([*arguments, "-"]):
        name, equals, value = this.partition("=")
        if name in names:
            yield value if equals else following
