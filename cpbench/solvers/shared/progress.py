"""When iterates are looked at, how small what a method watches must be, and when it should give up: its error is no
number, blew up, does not fall."""

from __future__ import annotations

import math
import time

from cpbench.solvers.base import Record

BLOWN_UP = 1e12
"""A scaled error starts near 1; beyond this the iterates have diverged."""
GAIN = 0.99
"""The best error must fall below this times its old value within a window of iterations."""
SHARE = 8
"""Iterates are looked at after every iteration at first, and never later than after an eighth more of them."""

REDUCED = 0.3
"""Where what a method watches was as small as it had to be and the error was not, it must be as small as the error
wants, times this."""
LEAST = 1e-3
"""The most that it is reduced at once."""


def next_stop(done: int, until: int, record: Record | None) -> int:
    """Return where compiled iterations, which could run from `done` to `until`, come back: earlier only for what
    records."""
    return until if record is None else min(until, done + 1 + done // SHARE)


def reduced(threshold: float, error: float, tolerance: float) -> float:
    """Return the next threshold of what a method watches, which is met although the error is not within the
    tolerance."""
    return threshold * (min(REDUCED, max(LEAST, REDUCED * tolerance / error)) if error > 0.0 else REDUCED)


class Progress:
    """Errors of one run, as they come.

    Parameters
    ----------
    window : the least number of iterations without gain that counts as a stall; half of the iterations done so
        far when that is more, for slow convergence is not a stall.
    seconds : time of the run from now on [s]. unit : what its iterations are, for the message.
    """

    def __init__(self, window: int, seconds: float = math.inf, unit: str = "iterations") -> None:
        self._window, self._unit, self._deadline = window, unit, time.monotonic() + seconds
        self._best, self._since = math.inf, 0

    def trouble(self, iteration: int, error: float) -> str | None:
        """Return what is wrong after `iteration` iterations, None when all goes well."""
        if not error < BLOWN_UP:
            what = "error above 1e12" if error > BLOWN_UP else "not a number"
            return f"diverged after {iteration} iterations ({what})"
        if error < GAIN * self._best:
            self._best, self._since = error, iteration
        if iteration - self._since > max(self._window, iteration // 2):
            return f"stalled at {self._best:.1e} after {iteration} iterations"
        if time.monotonic() > self._deadline:
            return f"out of time after {iteration} {self._unit}"
        return None
