"""How a process of a run begins: by which means, with what loaded, and its first steps.

On Linux it comes from a forkserver that has the numerical packages loaded (`preload`): a start takes milliseconds.
The forkserver itself takes as long as whoever needs it takes to import the same packages: it begins before (`begin`).
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
from multiprocessing import forkserver
from multiprocessing.connection import Connection
from typing import Any

from cpbench.bench.processes import cgroup, confinement, guard, isolation
from cpbench.bench.processes.channel import Channel
from cpbench.bench.processes.isolation import Isolation
from cpbench.registry import DECLARED, PLUGIN_FILES

THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMBA_NUM_THREADS",
    "RAYON_NUM_THREADS",
)
SAFE_PATH = "PYTHONSAFEPATH"
WARNINGS = "PYTHONWARNINGS"
RESTARTS, PAUSE = 8, 1.0
"""How often a process is tried again that could not be started, and the longest pause before [s]: the forkserver may
be killed again and again (Linux does so where memory is short), and a new one takes a second to import everything."""
NO_LEAKS = "ignore:resource_tracker:UserWarning"
"""A guest that is killed leaves its semaphores to multiprocessing's tracker, which removes them and need not say so."""
PASSED_ON = ("CPBENCH_", "NUMBA_")
"""How variables begin that may have changed since the forkserver began, and that its children are to have."""
PRELOAD = "cpbench.bench.processes.preload"
EVERYTHING = "cpbench.bench.processes.preload_everything"


@dataclass(frozen=True)
class Context:
    """The way that processes of a run are made: by `start`, a context of multiprocessing, with these means of
    isolation."""

    start: Any
    isolation: Isolation


def begin(threads: int, *, few: bool) -> None:
    """Start the forkserver, if there is one, so that it imports what it preloads while we do something else.

    `few` : as of `context`, which asks for the same. Without effect where it runs.
    """
    if context(threads, few=few).isolation.forks:
        with _apart_from_here(), contextlib.suppress(OSError, EOFError):  # who needs it tries again, and says why
            forkserver.ensure_running()


def context(threads: int, asked: str | None = None, *, few: bool = False) -> Context:
    """Return the means of this system; thread counts are set before anything numerical is imported.

    few : whether each process loads the solvers and kernels that it needs, or the forkserver all of them once.
    """
    for variable in THREAD_VARIABLES:
        os.environ[variable] = str(threads)
    found = isolation.detect(asked)
    if found.cgroups:
        cgroup.remove_abandoned(found.cgroups)
    ctx = mp.get_context(found.start)
    if found.forks:
        ctx.set_forkserver_preload([PRELOAD] if few else [PRELOAD, EVERYTHING])
    return Context(ctx, found)


@dataclass(frozen=True)
class ProcessStart:
    """The settings that a new process gets."""

    connection: socket.socket
    output: Connection | None
    lifeline: Connection | None
    cgroup: str
    cpus: tuple[int, ...]
    isolation: Isolation
    variables: Mapping[str, str]


def passed_on() -> dict[str, str]:
    """Our variables of `PASSED_ON`, as they are now."""
    return {name: value for name, value in os.environ.items() if name.startswith(PASSED_ON)}


def started(ctx: Any, start: ProcessStart, target: Callable[..., None], args: tuple[Any, ...]) -> Any:
    """Return a new process running `target(channel, *args)`; a forkserver that somebody killed is replaced. Raises
    OSError."""
    why = ""
    for attempt in range(1 + RESTARTS):
        time.sleep(min(PAUSE, 0.1 * 2**attempt) if attempt else 0.0)
        process = ctx.Process(target=_enter, args=(start, target, args), daemon=True)
        try:
            with _apart_from_here():
                process.start()
            return process
        except (OSError, EOFError) as cause:
            why = f"{type(cause).__name__}: {cause}"
    raise OSError(why)


@contextlib.contextmanager
def _apart_from_here() -> Generator[None]:
    """Yield the forkserver, where it starts now, is not to import a `numpy.py` of the folder that the run was started
    in, and
    its tracker of resources is not to talk of those of guests. Nor is a child to import the script that began the run,
    as multiprocessing would have it: that script would begin the run again.
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
        PLUGIN_FILES: "",  # a child has those of its own run, which need not be those of the forkserver's first
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
"""Held while a process starts: what is changed for it is of the whole process."""
_here: Isolation | None = None
"""The means by which this process was started, None in the runner."""


def _enter(start: ProcessStart, target: Callable[..., None], args: tuple[Any, ...]) -> None:
    """First steps of every child: its group, its session, its cores, its guard; its output into the log."""
    global _here
    _here = start.isolation
    os.environ.update(start.variables)
    if hasattr(os, "setsid"):
        os.setsid()
    isolation.pin(start.cpus)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the runner's to handle
    isolation.no_core_dumps()
    if start.output is not None:
        for descriptor in (1, 2):
            os.dup2(start.output.fileno(), descriptor)
        start.output.close()
    if start.lifeline is None:
        target(Channel(start.connection), *args)
        return
    work = lambda: target(Channel(start.connection), *args)  # noqa: E731
    guard.run_guarded(start.cgroup, start.lifeline, start.connection.close, work)


def limit_memory(growth: int) -> None:
    """Let this process grow by at most `growth` bytes (0: no limit), where it is not limited from outside."""
    if growth > 0 and _here is not None and _here.memory == "rlimit":
        isolation.limit_address_space(growth)


def confine(scratch: str, *, own: bool) -> None:
    """Keep what this process writes within `scratch` and caches, where the system can (`confinement.confine`)."""
    if _here is not None:
        confinement.confine(_here, scratch, own)


def forks() -> bool:
    """Return whether this process, started by a runner, may fork."""
    return _here is not None and _here.forks
