"""Warm-ups that wait until they are needed: a process that solves one problem loads what this one takes.

A run warms a solver up completely before it times anything, so that nothing below happens there.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Generator

from cpbench.foundation import kernel_cache
from cpbench.solvers.base import Solver, solvers

_warm: set[str] = set()
"""Solvers that have warmed up completely in this process."""
_begun: set[str] = set()
"""Solvers that have warmed up as far as every solve needs."""
_listeners: list[Callable[[bool], None]] = []
_depth = 0
_seconds = 0.0


@contextlib.contextmanager
def off_the_clock() -> Generator[None]:
    """Count what happens inside as loading or compiling, which is no part of a solver's time."""
    global _depth, _seconds
    _depth += 1
    begun = time.perf_counter()
    if _depth == 1:
        _tell(True)
    try:
        yield
    finally:
        _depth -= 1
        if not _depth:
            _seconds += time.perf_counter() - begun
            _tell(False)


kernel_cache.load_within(off_the_clock)


def listen(listener: Callable[[bool], None]) -> None:
    """Have this called with True where something begins that is off the clock, and with False where it has ended."""
    _listeners.append(listener)


def _tell(begins: bool) -> None:
    for listener in _listeners:
        listener(begins)


def seconds() -> float:
    """Return what this process has spent off the clock so far [s]."""
    return _seconds


def now() -> float:
    """Return the time that deadlines of solvers which call others are set by [s]: `time.monotonic`, less what has been
    off the clock."""
    return time.monotonic() - _seconds


def ready(name: str, *, quickly: bool) -> Solver:
    """Return the solver of a name, warmed up completely, or as far as every solve needs.

    Raises UnknownName.
    """
    if name in (_begun if quickly else _warm):
        return solvers.get(name)
    with off_the_clock():
        solver = solvers.get(name)
        (warm_up_quickly if quickly else warm_up)(solver)
    return solver


def warm_up(solver: Solver) -> None:
    """Warm a solver up completely, once a process."""
    if solver.spec.name not in _warm:
        with off_the_clock():
            solver.warmup()
        _warm.add(solver.spec.name)
        _begun.add(solver.spec.name)


def warm_up_quickly(solver: Solver) -> None:
    """Warm a solver up as far as every solve needs, once a process."""
    if solver.spec.name not in _begun:
        with off_the_clock():
            solver.warmup_quickly()
        _begun.add(solver.spec.name)
