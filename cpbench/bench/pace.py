"""The time that the rest of a run will take, estimated from the pairs that have ended.

Blocks are run in random order, so that the pairs which have ended are a sample of all. Those of the last minute count,
since a machine that others share becomes faster or slower while a run lasts. Their times are not independent,
since those of one problem are alike; the error of the mean is therefore taken from the means of batches of neighbours.
B. Schmeiser, Batch size effects in the analysis of simulation output, Operations Research 30, 1982: ten to thirty
batches.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import monotonic

import numpy as np

from cpbench.bench.events import Done, Event, Solving, Starting
from cpbench.bench.planning.quantities import duration

FEWEST = 20
"""Pairs below which nothing is estimated."""
BATCHES = 20
RECENT, ENOUGH = 60.0, 200
"""Time of the pairs that an estimate rests on [s], and the number of pairs below which it rests on more time."""
LEVEL = 0.95
"""Share of runs whose time is within the interval, where times are spread as in the sample."""


@dataclass(frozen=True)
class Expected:
    """The time that something is expected to take, and the ends of an interval around it [s]."""

    mean: float
    low: float
    high: float

    def __str__(self) -> str:
        low, high = duration(self.low), duration(self.high)
        return f"about {duration(self.mean)}" + (f", {low} to {high}" if low != high else "")


def expected(seconds: Sequence[float], left: int) -> Expected | None:
    """Return how long `left` more draws take of which some took `seconds`; None where these are fewer than FEWEST.

    The interval is that of a prediction: the sample may be unlike the rest, and the rest varies itself.
    """
    count = len(seconds)
    if count < FEWEST:
        return None
    from scipy.special import stdtrit  # a run of a few pairs does not need it

    mean = math.fsum(seconds) / count
    batches = min(BATCHES, count // 2)
    means = [float(np.mean(batch)) for batch in np.array_split(np.asarray(seconds), batches)]
    of_mean = float(np.var(means, ddof=1)) / batches
    spread = math.sqrt(of_mean * (1.0 + count / max(left, 1)))
    around = float(stdtrit(batches - 1, 0.5 + LEVEL / 2)) * spread
    return Expected(left * mean, left * max(mean - around, 0.0), left * (mean + around))


def recent(seconds: Sequence[float]) -> Sequence[float]:
    """Return the last of the times which together make RECENT, or the last ENOUGH where these make more."""
    total, first = 0.0, len(seconds)
    while first > 0 and (total < RECENT or len(seconds) - first < ENOUGH):
        first -= 1
        total += seconds[first]
    return seconds[first:]


class Pace:
    """The pace of a run, from its events: the time between the ends of two pairs, without what solvers take to start.

    What was before the end of the first pair says nothing: processes and machines start, too.

    slots : solves at a time; the start of a solver holds up one of them. clock : seconds since some moment.
    """

    def __init__(self, slots: int = 1, clock: Callable[[], float] = monotonic) -> None:
        self._slots, self._clock = slots, clock
        self._seconds: list[float] = []
        self._last: float | None = None
        self._starting: float | None = None
        self._held = 0.0

    @property
    def pairs(self) -> int:
        """Number of pairs whose time is known."""
        return len(self._seconds)

    @property
    def seconds(self) -> float:
        """The time of these pairs [s]."""
        return math.fsum(self._seconds)

    def note(self, event: Event) -> None:
        """Take an event of the run."""
        now = self._clock()
        if isinstance(event, Starting):
            self._starting = now if self._starting is None else self._starting
        elif isinstance(event, Solving) and self._starting is not None:
            self._held += (now - self._starting) / self._slots
            self._starting = None
        elif isinstance(event, Done):
            if self._last is not None:
                self._seconds.append(max(now - self._last - self._held, 0.0))
            self._last, self._held = now, 0.0

    def expected(self, left: int) -> Expected | None:
        """Return how long so many more pairs take at the pace of the last minute, without the start of further solvers;
        None after a few only."""
        return expected(recent(self._seconds), left)
