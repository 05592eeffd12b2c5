"""Start-up of a run's processes: context, preload, first steps.

They come from a forkserver that has loaded the numerical packages (`preload`): a start takes milliseconds. The
forkserver itself takes as long as a command takes to import the same packages, hence it is started first (`begin`).
"""

from __future__ import annotations

import contextlib
import multiprocessing as mp
import os
import signal
import socket
import sys
import threading
import time
import types
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from multiprocessing import forkserver, util
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerContext
from typing import Any

from cpbench.bench.processes import guard, isolation
from cpbench.bench.processes.channel import Channel
from cpbench.foundation.child_processes import THREAD_VARIABLES as THREAD_VARIABLES
from cpbench.foundation.locks import TemporaryHome
from cpbench.registry import DECLARED, PLUGIN_FILES

SAFE_PATH = "PYTHONSAFEPATH"
WARNINGS = "PYTHONWARNINGS"
RESTARTS, PAUSE = 8, 1.0
"""How often a start that failed is repeated, and the longest pause before it [s]: where memory is short Linux may kill
the forkserver again and again, and a new one takes a second to import everything."""
NO_LEAKS = "ignore:resource_tracker:UserWarning"
"""Filter of a warning: multiprocessing's tracker reports semaphores of guests that were killed, and removes them."""
PASSED_ON = "CPBENCH_"
"""Prefix of the variables that children get as they are now, not as they were when the forkserver started."""
PRELOAD = "cpbench.bench.processes.preload"


def begin(threads: int) -> None:
    """Start the forkserver, so that it imports while the caller does something else; without effect where it runs."""
    context(threads)
    with _isolated_start(), contextlib.suppress(OSError, EOFError):  # `started` tries again
        forkserver.ensure_running()


def context(threads: int) -> ForkServerContext:
    """Return the context of multiprocessing, after thread counts were set for what is imported from here on.

    The address of its forkserver lies in a folder with a lock: where this process is killed, the next one removes it.
    """
    config = mp.current_process()._config  # pyright: ignore[reportAttributeAccessIssue]
    if config.get("tempdir") is None:
        home = TemporaryHome("pymp-")
        config["tempdir"] = str(home.folder)
        util.Finalize(None, home.remove, exitpriority=-100)  # as late as multiprocessing removes its own
    for variable in THREAD_VARIABLES:
        os.environ[variable] = str(threads)
    ctx = mp.get_context("forkserver")
    ctx.set_forkserver_preload([PRELOAD])
    return ctx


@dataclass(frozen=True)
class ProcessStart:
    """The settings that a new process gets."""

    connection: socket.socket
    output: Connection
    lifeline: Connection
    cpus: tuple[int, ...]
    variables: Mapping[str, str]


def passed_on() -> dict[str, str]:
    """Return the variables of `PASSED_ON` as they are now."""
    return {name: value for name, value in os.environ.items() if name.startswith(PASSED_ON)}


def started(ctx: Any, start: ProcessStart, target: Callable[..., None], args: tuple[Any, ...]) -> Any:
    """Return a new process running `target(channel, *args)`; a forkserver that was killed is replaced. Raises
    OSError."""
    why = ""
    for attempt in range(1 + RESTARTS):
        time.sleep(min(PAUSE, 0.1 * 2**attempt) if attempt else 0.0)
        process = ctx.Process(target=_enter, args=(start, target, args), daemon=True)
        try:
            with _isolated_start():
                process.start()
            return process
        except (OSError, EOFError) as cause:
            why = f"{type(cause).__name__}: {cause}"
    raise OSError(why)


@contextlib.contextmanager
def _isolated_start() -> Generator[None]:
    """Start processes within this context independently of the current folder and of the running script.

    A forkserver that starts within must not import a `numpy.py` of the current folder, and its resource tracker must
    not warn about guests. A child must not import the running script, as multiprocessing would: the script would start
    the run again.
    """
    with _starting:
        main = sys.modules["__main__"]
        sys.modules["__main__"] = types.ModuleType("__main__")
        try:
            with _variables():
                yield
        finally:
            sys.modules["__main__"] = main


@contextlib.contextmanager
def _variables() -> Generator[None]:
    wanted = {
        SAFE_PATH: os.environ.get(SAFE_PATH, "1"),
        WARNINGS: ",".join(filter(None, (os.environ.get(WARNINGS), NO_LEAKS))),
        PLUGIN_FILES: "",  # a child gets those of its own run, which may differ from those at the forkserver's start
        DECLARED: "",
    }
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


_starting = threading.Lock()
"""Held while a process starts, because variables and modules of the whole process are changed for it."""


def _enter(start: ProcessStart, target: Callable[..., None], args: tuple[Any, ...]) -> None:
    """Take the first steps of every child: session, cores, log, guard; then run `target`."""
    os.environ.update(start.variables)
    os.setsid()
    isolation.pin(start.cpus)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the runner handles Ctrl-C
    isolation.no_core_dumps()
    for descriptor in (1, 2):
        os.dup2(start.output.fileno(), descriptor)
    start.output.close()
    work = lambda: target(Channel(start.connection), *args)  # noqa: E731
    guard.run_guarded(start.lifeline, start.connection.close, work)
