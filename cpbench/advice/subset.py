"""A part of the problems that costs little and still tells the solvers apart: greedy submodular maximisation.

Of `outcomes` (times [s], problems × labels; ∞ not solved, NaN where a label does not take part) let d_p(a, b) in [0, 1]
say how clearly problem p puts a before b: 1 where a solves it and b does not, else log4(t_b / t_a) within [0, 1], times
below the floor counting as the floor. The value of a set S of problems is

    f(S) = sum over ordered pairs (a, b) of sqrt( sum over p in S of d_p(a, b) ),

a sum of concave functions of modular ones: f grows with S, and each problem adds less the more is there (submodular),
so that the first problem to tell two solvers apart is worth most. What everybody solves at once or nobody solves adds
nothing.

1. Every family that fits is represented by its cheapest problem, the cheapest family first.
2. The rest of the budget is filled twice, by gain and by gain per cost, and the better of the two is kept.

With the budget as a number of problems, step 2 reaches 1 - 1/e of the best possible gain (Nemhauser, Wolsey and Fisher,
Mathematical Programming 14, 1978); with costs, the better of the two orders reaches half of that (Leskovec et al., KDD
2007, section 3.1). Stale gains are bounds, so that few are computed again (Minoux 1978).
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from cpbench.analysis.profiles import FLOOR

CLEAR = 4.0
"""Factor between two times that puts one solver before the other as clearly as a failure does."""

Array: TypeAlias = np.ndarray[Any, np.dtype[Any]]


@dataclass(frozen=True)
class Pick:
    """A chosen problem: what it costs [s], what it adds to the value (part of that of all problems), and whether it was
    taken as the representative of its family."""

    problem: Hashable
    family: str
    cost: float
    gain: float
    representative: bool


@dataclass(frozen=True)
class Subset:
    """Chosen problems, in that order. `value` : f(chosen) / f(all), 1 where nothing tells the solvers apart.
    `missed` : families that did not fit, with the cost of their cheapest problem [s]. `order` : which of the two
    orders was the better one."""

    picks: tuple[Pick, ...]
    value: float
    missed: Mapping[str, float]
    order: str

    @property
    def problems(self) -> list[Hashable]:
        return [pick.problem for pick in self.picks]

    @property
    def cost(self) -> float:
        """Total cost [s]."""
        return math.fsum(pick.cost for pick in self.picks)


class SubsetValue:
    """f of a growing set of problems."""

    def __init__(self, outcomes: pd.DataFrame, floor: float = FLOOR) -> None:
        times = np.maximum(outcomes.to_numpy(dtype=float), floor)  # NaN stays
        self._levels = np.log2(times) / math.log2(CLEAR)
        self._seen = np.zeros((times.shape[1], times.shape[1]))
        self._roots = self._seen
        self.total = 0.0

    def gain(self, row: int) -> float:
        """Return how much the problem in this row would add."""
        return float(np.sum(np.sqrt(self._seen + self._separation(row)) - self._roots))

    def add(self, row: int) -> float:
        """Add the problem in this row; what it added."""
        gained = self.gain(row)
        self._seen = self._seen + self._separation(row)
        self._roots = np.sqrt(self._seen)
        self.total += gained
        return gained

    def _separation(self, row: int) -> Array:
        """Return d of the problem in this row, labels × labels; 0 where one does not take part, or of two failures."""
        level = self._levels[row]
        with np.errstate(invalid="ignore"):
            ahead = level[np.newaxis, :] - level[:, np.newaxis]
        return np.fmin(np.fmax(ahead, 0.0), 1.0)


def value(outcomes: pd.DataFrame, problems: Sequence[Hashable], floor: float = FLOOR) -> float:
    """Return f(problems) / f(all), 1 where nothing tells the labels apart.

    >>> times = pd.DataFrame({"a": [1.0, 1.0, 1.0], "b": [4.0, 1.0, math.inf]}, index=["p", "q", "r"])
    >>> value(times, ["q"]), round(value(times, ["p"]), 4), value(times, ["p", "r"])
    (0.0, 0.7071, 1.0)
    """
    whole, part = SubsetValue(outcomes, floor), SubsetValue(outcomes, floor)
    chosen = set(problems)
    for row, problem in enumerate(outcomes.index):
        whole.add(row)
        if problem in chosen:
            part.add(row)
    return part.total / whole.total if whole.total > 0 else 1.0


def choose(
    outcomes: pd.DataFrame,
    cost: pd.Series[float],
    families: pd.Series[str],
    budget: float,
    seed: int = 0,
    floor: float = FLOOR,
) -> Subset:
    """Choose the problems of `outcomes` to take within a budget [s]; `seed` decides between equal ones.

    Parameters
    ----------
    cost [s], families : of each problem, by the index of `outcomes`. Raises ValueError on a cost that is not positive.

    >>> times = pd.DataFrame({"a": [1.0, 1.0, 1.0], "b": [4.0, 1.0, math.inf]}, index=["p", "q", "r"])
    >>> cost, families = pd.Series([2.0, 1.0, 3.0], index=times.index), pd.Series(["f", "f", "g"], index=times.index)
    >>> choose(times, cost, families, budget=4.0).problems, choose(times, cost, families, budget=2.5).problems
    (['q', 'r'], ['q'])
    """
    costs = cost.reindex(outcomes.index).to_numpy(dtype=float)
    if not (costs > 0).all():
        raise ValueError(f"cost of {float(np.nanmin(costs))} s: every problem needs a positive one")
    family = families.reindex(outcomes.index).astype(str).to_numpy()
    ties = np.random.default_rng(seed).permutation(len(outcomes))
    # equal problems are told apart by the seed, whatever order they came in
    ties = ties[np.argsort(np.argsort(outcomes.index.to_numpy(), kind="stable"), kind="stable")]
    first, missed = _representatives(family, costs, ties, budget)
    tried = [_filled(outcomes, costs, ties, first, budget, by_cost, floor) for by_cost in (True, False)]
    better = 0 if tried[0][0].total >= tried[1][0].total else 1
    held, chosen = tried[better]
    whole = SubsetValue(outcomes, floor)
    for row in range(len(outcomes)):
        whole.add(row)
    scale = whole.total if whole.total > 0 else 1.0
    index, representing = list(outcomes.index), set(first)
    picks = tuple(
        Pick(index[row], str(family[row]), float(costs[row]), gained / scale, row in representing)
        for row, gained in chosen
    )
    return Subset(picks, held.total / scale if whole.total > 0 else 1.0, missed, ("gain per cost", "gain")[better])


def scores(outcomes: pd.DataFrame, floor: float = FLOOR) -> pd.Series[float]:
    """Score every label by the mean, over the problems on which it takes part, of least time over its time (0: not
    solved).

    >>> scores(pd.DataFrame({"a": [1.0, 1.0], "b": [4.0, math.inf], "c": [math.nan, 2.0]})).tolist()
    [1.0, 0.125, 0.5]
    """
    times = outcomes.clip(lower=floor)
    best = times.min(axis=1)
    share = times.rdiv(best, axis=0).where(np.isfinite(times), 0.0).where(times.notna())
    return share.mean()


def agreement(outcomes: pd.DataFrame, problems: Sequence[Hashable], floor: float = FLOOR) -> tuple[float, int]:
    """Return Kendall's τ_b of the labels' scores on `problems` with those on all, and how many labels take part in
    both.

    NaN below two labels, and where all of them score the same.
    """
    from scipy.stats import kendalltau

    part = scores(outcomes.loc[list(problems)], floor).dropna()
    whole = scores(outcomes, floor)[part.index]
    if len(part) < 2 or part.nunique() < 2 or whole.nunique() < 2:
        return math.nan, len(part)
    return float(kendalltau(whole, part, variant="b").statistic), len(part)


def _representatives(family: Array, costs: Array, ties: Array, budget: float) -> tuple[list[int], dict[str, float]]:
    """Choose the cheapest problem of every family that fits, cheapest first, and list the families that do not fit."""
    cheapest: dict[str, int] = {}
    for row in np.lexsort((ties, costs)):
        cheapest.setdefault(str(family[row]), int(row))
    taken: list[int] = []
    missed: dict[str, float] = {}
    left = budget
    for name, row in cheapest.items():
        if costs[row] <= left:
            taken.append(row)
            left -= float(costs[row])
        else:
            missed[name] = float(costs[row])
    return taken, missed


def _filled(
    outcomes: pd.DataFrame,
    costs: Array,
    ties: Array,
    first: Sequence[int],
    budget: float,
    by_cost: bool,
    floor: float,
) -> tuple[SubsetValue, list[tuple[int, float]]]:
    """Fill the budget greedily, beginning with `first`; return the value, and the rows with what each added.

    `by_cost` : gain per cost decides, else gain alone.
    """
    held = SubsetValue(outcomes, floor)
    chosen = [(row, held.add(row)) for row in first]
    left = budget - math.fsum(costs[row] for row in first)
    worth = np.where(by_cost, costs, 1.0)
    free = sorted(set(range(len(outcomes))) - set(first))
    queue = [(-math.inf, int(ties[row]), row, -1) for row in free]
    heapq.heapify(queue)
    while queue:
        bound, tie, row, at = heapq.heappop(queue)
        if costs[row] > left:
            continue
        if at < len(chosen):  # what it added before is an upper bound of what it adds now
            heapq.heappush(queue, (-held.gain(row) / worth[row], tie, row, len(chosen)))
            continue
        if bound >= 0.0:
            break
        chosen.append((row, held.add(row)))
        left -= float(costs[row])
    return held, chosen
