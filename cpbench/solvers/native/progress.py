"""When an iterative method should give up: its error is no number, has blown up, or has stopped falling."""

from __future__ import annotations

import math

BLOWN_UP = 1e12
"""A scaled error starts near 1; beyond this the iterates have diverged."""
GAIN = 0.99
"""The best error must fall below this times its old value within a window of iterations."""


class Progress:
    """Follows the errors of one run.

    Parameters
    ----------
    window : the least number of iterations without gain that counts as a stall; half of the iterations done so
        far when that is more, for slow convergence is not a stall.
    """

    def __init__(self, window: int) -> None:
        self._window = window
        self._best, self._since = math.inf, 0

    def trouble(self, iteration: int, error: float) -> str | None:
        """What is wrong after `iteration` iterations, None when all goes well."""
        if not error < BLOWN_UP:
            what = "error above 1e12" if error > BLOWN_UP else "not a number"
            return f"diverged after {iteration} iterations ({what})"
        if error < GAIN * self._best:
            self._best, self._since = error, iteration
        if iteration - self._since > max(self._window, iteration // 2):
            return f"stalled at {self._best:.1e} after {iteration} iterations"
        return None
