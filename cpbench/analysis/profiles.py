"""Performance profiles of Dolan and Moré, Mathematical Programming 91 (2002), of costs with a floor.

    r[p, s] = t[p, s] / min_s t[p, s],      ρ_s(τ) = #{p : r[p, s] ≤ τ} / N

t is what a solver spent: seconds, iterations, bytes (`metrics`). ρ_s is a step function, continuous from the right,
with its steps at the ratios themselves (no grid). A failure has t = ∞ and so r = ∞, never a finite multiple of
something; a problem that no solver solves stays among the N, so that ρ_s(∞) is the fraction of problems that s solves.
Equal costs share the lead. A cost below the floor counts as the floor, which is what lets a count be 0: this is the one
deviation from Dolan and Moré, whose t has none. Where no cost is below it the profile is theirs exactly; else only
ratios of problems change that someone solves below the floor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from cpbench.analysis.table import Floats

FLOOR = 1e-4
"""Seconds below which a time counts as this much: the call itself then weighs as much as the algorithm."""


@dataclass(frozen=True)
class Curve:
    """One step function: height(τ) = count[k] / problems for ratios[k] ≤ τ < ratios[k+1], and 0 below ratios[0].

    Attributes
    ----------
    ratios : where it steps, distinct, finite, ascending, at least 1. count : problems solved within each of them.
    problems : N, the planned number, without those of which a conversion lost the answer.
    """

    label: str
    ratios: Floats
    count: tuple[int, ...]
    problems: int

    def at(self, tau: float) -> float:
        """Return ρ(τ).

        >>> curve = Curve("s", np.array([1.0, 2.0]), (1, 3), 4)
        >>> [curve.at(tau) for tau in (0.5, 1.0, 1.99, 2.0, math.inf)]
        [0.0, 0.25, 0.25, 0.75, 0.75]
        """
        k = int(np.searchsorted(self.ratios, tau, side="right"))
        return self.count[k - 1] / self.problems if k else 0.0

    def heights(self, taus: Floats) -> Floats:
        """Return ρ at each of many τ."""
        reached = np.array((0, *self.count), dtype=np.int64)
        return reached[np.searchsorted(self.ratios, taus, side="right")] / max(self.problems, 1)

    @property
    def solved(self) -> int:
        """Problems solved at all."""
        return self.count[-1] if self.count else 0

    def steps(self, upto: float) -> tuple[Floats, Floats]:
        """Return corners (τ, ρ) of the curve on [1, upto], each value holding up to the next corner.

        >>> x, y = Curve("s", np.array([2.0]), (1,), 2).steps(4.0)
        >>> x.tolist(), y.tolist()
        ([1.0, 2.0, 4.0], [0.0, 0.5, 0.5])
        """
        inside = self.ratios[(self.ratios > 1.0) & (self.ratios < upto)]
        tau = np.concatenate(([1.0], inside, [upto]))
        return tau, self.heights(tau)

    def outline(self, upto: float, most: int) -> tuple[Floats, Floats]:
        """Return at most `most` of the corners of `steps`, both ends among them, evenly along their number; nowhere
        above the curve, and of N steps of 1 / N nowhere lower by more than 1 / (most - 1).

        >>> x, y = Curve("s", np.arange(1.0, 101.0), tuple(range(1, 101)), 100).outline(128.0, 3)
        >>> x.tolist(), y.tolist()
        ([1.0, 51.0, 128.0], [0.01, 0.51, 1.0])
        """
        tau, height = self.steps(upto)
        if len(tau) <= most:
            return tau, height
        kept = np.linspace(0, len(tau) - 1, most).round().astype(int)
        return tau[kept], height[kept]

    def area(self, upto: float) -> float:
        """Return the mean height over log₂ τ between 1 and `upto`: one number for fast and reliable together.

        >>> Curve("s", np.array([2.0]), (1,), 1).area(4.0)
        0.5
        """
        if upto <= 1.0:
            return self.at(1.0)
        tau, height = self.steps(upto)
        return float(np.sum(height[:-1] * np.diff(np.log2(tau))) / math.log2(upto))


@dataclass(frozen=True)
class Profile:
    """The curves of a group, in order of label. `floor` is the least cost that counts, in its unit; 0 without one."""

    curves: tuple[Curve, ...]
    problems: int
    floor: float

    @property
    def widest(self) -> float:
        """The largest finite ratio, 1 when there is none: every curve is flat beyond it."""
        return max((float(c.ratios[-1]) for c in self.curves if c.solved), default=1.0)

    @property
    def compares(self) -> bool:
        """Return whether several solvers solved something; else the curves say no more than how many were solved."""
        return sum(curve.solved > 0 for curve in self.curves) > 1

    def by_height(self) -> list[Curve]:
        """Sort curves as they lie at the right margin, highest first; ties by area, then label."""
        widest = self.widest
        return sorted(self.curves, key=lambda c: (-c.solved, -c.area(widest), c.label))

    def leading(self, count: int) -> list[str]:
        """Return labels of the `count` curves of largest area (those that solve something), ties by label."""
        widest = self.widest
        alive = [c for c in self.curves if c.solved]
        return [c.label for c in sorted(alive, key=lambda c: (-c.area(widest), c.label))[:count]]


def ratios(values: pd.DataFrame, floor: float | None = FLOOR) -> pd.DataFrame:
    """Compute r[p, s] of costs, problems × labels; ∞ where not solved.

    Parameters
    ----------
    floor : a smaller cost counts as this much (default: seconds); None where the cost cannot come near 0.

    Raises ValueError on a negative cost, on a floor that is not positive, and on a cost of 0 without a floor.

    >>> ratios(pd.DataFrame({"a": [1.0, math.inf], "b": [3.0, math.inf]}))["b"].tolist()
    [3.0, inf]
    """
    cost = costs(values, floor)
    best = cost.min(axis=1, keepdims=True, initial=math.inf)
    with np.errstate(invalid="ignore"):
        # ∞/∞ where no solver solved it: a failure for all, not a number
        quotient = np.where(np.isinf(cost), math.inf, cost / best)
    return pd.DataFrame(quotient, index=values.index, columns=values.columns, copy=False)


def costs(values: pd.DataFrame, floor: float | None = FLOOR) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Return the costs to compare: failures ∞, all others at least the floor. Raises as `ratios` does.

    >>> costs(pd.DataFrame({"a": [0.0, float("nan")], "b": [3.0, 4.0]}), floor=1.0).tolist()
    [[1.0, 3.0], [inf, 4.0]]
    """
    if floor is not None and not floor > 0:
        raise ValueError(f"floor of {floor}: must be positive, else the ratio to a cost of 0 has no meaning")
    cost = values.to_numpy(dtype=float, copy=True)
    cost[np.isnan(cost)] = math.inf
    if (cost < 0).any():
        raise ValueError(f"negative cost {cost.min():.3g}: no ratio to it has a meaning")
    if floor is None and (cost == 0).any():
        raise ValueError("a cost of 0 needs a floor: say how small a cost counts as how much")
    return cost if floor is None else np.maximum(cost, floor, out=cost)


def performance_profile(
    values: pd.DataFrame, problems: int | None = None, floor: float | None = FLOOR, lost: pd.DataFrame | None = None
) -> Profile:
    """Return the profile of costs, problems × labels, ∞ or NaN for a failure.

    Parameters
    ----------
    problems : N, when more problems were planned than the table has rows. Raises ValueError when fewer.
    floor : smaller costs count as this (default: seconds); does not touch the other problems.
    lost : whether a conversion lost the answer of a pair (`table.lost`): that problem is not among those of the curve.

    >>> times = pd.DataFrame({"fast": [1.0, 1.0, math.inf], "slow": [4.0, 1.0, 8.0]}, index=["p", "q", "r"])
    >>> fast, slow = performance_profile(times).curves
    >>> [round(fast.at(tau), 2) for tau in (1, 2, 4, math.inf)]
    [0.67, 0.67, 0.67, 0.67]
    >>> [round(slow.at(tau), 2) for tau in (1, 2, 4, math.inf)]
    [0.67, 0.67, 1.0, 1.0]
    """
    if problems is not None and problems < len(values):
        raise ValueError(f"{problems} problems planned, but the table has {len(values)}")
    planned = len(values) if problems is None else problems
    where = ratios(values, floor)
    without = {} if lost is None else lost.sum().to_dict()
    labels: Sequence[str] = sorted(where.columns)
    curves = tuple(
        _curve(label, where[label].to_numpy(dtype=float), planned - int(without.get(label, 0))) for label in labels
    )
    return Profile(curves, planned, floor or 0.0)


def _curve(label: str, steps: Floats, problems: int) -> Curve:
    distinct, count = np.unique(steps[np.isfinite(steps)], return_counts=True)
    return Curve(label, distinct, tuple(np.cumsum(count).tolist()), problems)
