"""How good a configuration is: first how many problems it solves, then how long it takes.

The time is the shifted geometric mean over all problems (Achterberg, Constraint Integer Programming, 2007, appendix
A.3), each problem that is not solved charged ten times the limit: PAR10 of Hutter, Hoos, Leyton-Brown and Stützle,
ParamILS, JAIR 36 (2009). Whether a problem is solved is our verdict, never the solver's claim.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from cpbench.bench.results.rows import Outcome
from cpbench.verification import VERIFIED

NAME = "problems solved, then PAR10 as a shifted geometric mean"
CHARGE = 10.0
"""Cost of an unsolved problem, in limits."""
SHIFT = 1e-3
"""Seconds added to every time before its logarithm: below that a call weighs as much as the algorithm."""
GAIN = 0.9
"""Ratio of a mean to another one from which it counts as a gain, where as many problems are solved."""
PARTS = ("convert", "setup", "solve", "lift")


@dataclass(frozen=True, order=True)
class Score:
    """The less the better: problems not solved, then the mean [s]; `problems` it was taken over."""

    unsolved: int
    mean: float
    problems: int

    def gains_on(self, other: Score) -> bool:
        """Return whether this is better by more than times differ from one run to the next."""
        return self.unsolved < other.unsolved or (self.unsolved == other.unsolved and self.mean < GAIN * other.mean)

    def __str__(self) -> str:
        return f"{self.problems - self.unsolved} of {self.problems} solved, mean {self.mean:.3g} s"


def seconds(outcome: Outcome) -> float:
    """Return what a row's solve took [s]; ∞ unless the problem is solved.

    >>> seconds(Outcome(status="solved", convert=0.5, solve=1.0))
    1.5
    >>> seconds(Outcome(status="wrong", solve=1.0))
    inf
    """
    if outcome.status not in VERIFIED:
        return math.inf
    return math.fsum(getattr(outcome, part) or 0.0 for part in PARTS)


def score(times: Iterable[float], limit: float) -> Score:
    """Return the score of times [s], ∞ where a problem was not solved, under a limit [s].

    >>> score([1.0, math.inf], 4.0).unsolved
    1
    >>> round(score([1.0, math.inf], 4.0).mean, 3)  # sqrt(1.001 * 40.001) - 0.001
    6.327
    """
    times = list(times)
    charged = [t if math.isfinite(t) else CHARGE * limit for t in times]
    mean = math.exp(math.fsum(math.log(t + SHIFT) for t in charged) / len(charged)) - SHIFT if charged else math.inf
    return Score(sum(not math.isfinite(t) for t in times), mean, len(times))
