"""A clock of solvers that stands while loops are loaded or compiled, which does not count as a solver's time.

A run warms a solver up completely before it times anything, so that it does not stand there.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Generator

from cpbench.foundation import kernel_cache

_listeners: list[Callable[[bool], None]] = []
_depth = 0
_seconds = 0.0


@contextlib.contextmanager
def off_the_clock() -> Generator[None]:
    """Count what happens inside as loading or compiling."""
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


def now() -> float:
    """Return the time [s] by which solves are timed and deadlines set, less what this process has spent off the
    clock."""
    return time.perf_counter() - _seconds


def listen(listener: Callable[[bool], None]) -> None:
    """Have this called with True where something begins that is off the clock, and with False where it has ended."""
    _listeners.append(listener)


def _tell(begins: bool) -> None:
    for listener in _listeners:
        listener(begins)
