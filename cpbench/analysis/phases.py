"""Phases of a recorded sequence: stretches of steps on which a warm start saves about the same.

The steps are cut where that makes the sum of squares of log(warm / cold) around its mean in each phase, over all
solvers together, smaller by more than a new cut may cost: the variance of the noise times (number of solvers + 2) times
the logarithm of the number of values (N. Zhang and D. Siegmund, A modified Bayes information criterion, Biometrics 63,
2007, for one series). The noise is measured by differences of neighbouring steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pandas as pd

from cpbench.analysis.codes import Integers
from cpbench.foundation.matrices import Dense, Vector

MOST = 4
"""The most phases."""
SHORTEST = 5
"""Steps that a phase has at least."""
_MAD = 1.4826
"""Standard deviation over median absolute deviation of normal numbers (Rousseeuw and Croux, JASA 88, 1993)."""


@dataclass(frozen=True)
class Stretch:
    """Steps `first` to `last` of a sequence."""

    first: int
    last: int


def phases(found: pd.DataFrame) -> list[Stretch]:
    """Return the phases of a sequence, in their order; one where nothing changes.

    Parameters
    ----------
    found : columns step, label and ratio, as of `steps.steps`; rows without a ratio say nothing.
    """
    known = found[np.isfinite(found["ratio"]) & (found["ratio"] > 0)]
    wide = known.pivot_table(index="step", columns="label", values="ratio", aggfunc="median").map(np.log)
    if wide.empty:
        return []
    steps, values = wide.index.to_numpy(), wide.to_numpy(dtype=float)
    starts = [0, *_cuts(values), len(steps)]
    return [Stretch(int(steps[a]), int(steps[b - 1])) for a, b in pairwise(starts)]


def medians(found: pd.DataFrame, parts: list[Stretch]) -> pd.DataFrame:
    """Return, for each phase and label, the lower quartile, median and upper quartile of the ratio, and the number of
    steps they are of; columns phase (its place), label, low, median, high, steps."""
    rows: list[tuple[int, str, float, float, float, int]] = []
    for place, part in enumerate(parts):
        own = found[found["step"].between(part.first, part.last) & np.isfinite(found["ratio"])]
        for label, values in own.groupby("label")["ratio"]:
            low, median, high = (float(values.quantile(share)) for share in (0.25, 0.5, 0.75))
            rows.append((place, str(label), low, median, high, len(values)))
    return pd.DataFrame(rows, columns=["phase", "label", "low", "median", "high", "steps"])


def _cuts(values: Dense) -> list[int]:
    """Return where phases begin but the first: of 1 to MOST phases the number whose price is least.

    values : (steps, labels), NaN where there is none.
    """
    count, labels = values.shape
    if count < 2 * SHORTEST:
        return []
    around = _squares(values)
    cost = np.full((MOST + 1, count + 1), np.inf)
    before = np.zeros((MOST + 1, count + 1), dtype=int)
    cost[0, 0] = 0.0
    for k in range(1, MOST + 1):
        for end in range(k * SHORTEST, count + 1):
            starts = np.arange((k - 1) * SHORTEST, end - SHORTEST + 1)
            prices = cost[k - 1, starts] + around(starts, end)
            best = int(prices.argmin())
            cost[k, end], before[k, end] = prices[best], starts[best]
    penalty = _noise(values) * (labels + 2) * np.log(np.isfinite(values).sum())
    total = [cost[k, count] + k * penalty for k in range(1, MOST + 1)]
    cuts, end = list[int](), count
    for k in range(int(np.argmin(total)) + 1, 1, -1):
        end = int(before[k, end])
        cuts.insert(0, end)
    return cuts


def _squares(values: Dense) -> Callable[[Integers, int], Vector]:
    """Return a function of places and an end: the sums of squares from each place to the end, around the mean of each
    column."""
    there = np.isfinite(values)
    filled = np.where(there, values, 0.0)
    zero = np.zeros((1, values.shape[1]))
    parts = [np.vstack((zero, part.cumsum(axis=0))) for part in (there.astype(float), filled, filled * filled)]

    def between(starts: Integers, end: int) -> Vector:
        n, total, squares = (part[end] - part[starts] for part in parts)
        return (squares - total * total / np.maximum(n, 1.0)).sum(axis=1)

    return between


def _noise(values: Dense) -> float:
    """Return the variance of a value around the mean of its phase, by differences of neighbours."""
    apart: Vector = np.abs(np.diff(values, axis=0))
    apart = apart[np.isfinite(apart)]
    return float(_MAD * np.median(apart)) ** 2 / 2.0 if apart.size else 0.0
