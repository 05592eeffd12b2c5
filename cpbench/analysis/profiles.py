"""Performance profiles of Dolan and Moré, Mathematical Programming 91 (2002), exactly.

    r[p, s] = t[p, s] / min_s t[p, s],      ρ_s(τ) = #{p : r[p, s] ≤ τ} / N

ρ_s is a step function, continuous from the right, with its steps at the ratios themselves (no grid). A failure has
t = ∞ and so r = ∞, never a finite multiple of something; a problem that nobody solves stays among the N, so that
ρ_s(∞) is the fraction of problems that s solves. Equal times share the lead.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TypeAlias

import numpy as np
import pandas as pd

FLOOR = 1e-4
"""Seconds below which a time counts as this much: the call itself then weighs as much as the algorithm."""

Floats: TypeAlias = np.ndarray[tuple[int], np.dtype[np.float64]]


@dataclass(frozen=True)
class Curve:
    """One step function: ρ(τ) = count[k] / problems for ratios[k] ≤ τ < ratios[k+1], and 0 below ratios[0].

    Attributes
    ----------
    ratios : distinct finite ratios, ascending, the first ≥ 1. count : problems solved within each of them.
    problems : N, the planned number.
    """

    label: str
    ratios: Floats
    count: tuple[int, ...]
    problems: int

    def at(self, tau: float) -> float:
        """ρ(τ).

        >>> curve = Curve("s", np.array([1.0, 2.0]), (1, 3), 4)
        >>> [curve.at(tau) for tau in (0.5, 1.0, 1.99, 2.0, math.inf)]
        [0.0, 0.25, 0.25, 0.75, 0.75]
        """
        k = int(np.searchsorted(self.ratios, tau, side="right"))
        return self.count[k - 1] / self.problems if k else 0.0

    @property
    def solved(self) -> int:
        """Problems solved at all."""
        return self.count[-1] if self.count else 0

    def steps(self, upto: float) -> tuple[Floats, Floats]:
        """Corners (τ, ρ) of the curve on [1, upto], each value holding up to the next corner.

        >>> x, y = Curve("s", np.array([2.0]), (1,), 2).steps(4.0)
        >>> x.tolist(), y.tolist()
        ([1.0, 2.0, 4.0], [0.0, 0.5, 0.5])
        """
        inside = self.ratios[(self.ratios > 1.0) & (self.ratios < upto)]
        tau = np.array([1.0, *inside, upto])
        return tau, np.array([self.at(t) for t in tau])

    def area(self, upto: float) -> float:
        """Mean height over log₂ τ between 1 and `upto`: one number for fast and reliable together.

        >>> Curve("s", np.array([2.0]), (1,), 1).area(4.0)
        0.5
        """
        if upto <= 1.0:
            return self.at(1.0)
        tau, height = self.steps(upto)
        return float(np.sum(height[:-1] * np.diff(np.log2(tau))) / math.log2(upto))


@dataclass(frozen=True)
class Profile:
    """The curves of a group, in order of label. `floor` is the shortest time told apart [s]."""

    curves: tuple[Curve, ...]
    problems: int
    floor: float

    @property
    def widest(self) -> float:
        """The largest finite ratio, 1 when there is none: every curve is flat beyond it."""
        return max((float(c.ratios[-1]) for c in self.curves if c.solved), default=1.0)

    def envelope(self, upto: float) -> tuple[Floats, Floats]:
        """Corners (τ, ρ) on [1, upto] of the highest curve at each τ, whichever that is."""
        corners = {float(r) for c in self.curves for r in c.ratios if 1.0 < r < upto}
        tau = np.array([1.0, *sorted(corners), upto])
        height = np.array([max((c.at(t) for c in self.curves), default=0.0) for t in tau])
        keep = np.array([True, *(np.diff(height[:-1]) > 0), True])
        return tau[keep], height[keep]

    def by_height(self) -> list[Curve]:
        """Curves as they lie at the right margin, highest first; ties by area, then label."""
        return sorted(self.curves, key=lambda c: (-c.solved, -c.area(self.widest), c.label))

    def leading(self, count: int) -> list[str]:
        """Labels of the `count` curves of largest area (those that solve something), ties by label."""
        alive = [c for c in self.curves if c.solved]
        return [c.label for c in sorted(alive, key=lambda c: (-c.area(self.widest), c.label))[:count]]


def ratios(times: pd.DataFrame, floor: float = FLOOR) -> pd.DataFrame:
    """r[p, s] of times [s], problems × labels; ∞ where not solved.

    Raises ValueError on a negative time and on a floor that is not positive.

    >>> ratios(pd.DataFrame({"a": [1.0, math.inf], "b": [3.0, math.inf]}))["b"].tolist()
    [3.0, inf]
    """
    if not floor > 0:
        raise ValueError(f"floor of {floor} s: must be positive, else the ratio to a time of 0 has no meaning")
    seconds = times.to_numpy(dtype=float, copy=True)
    seconds[np.isnan(seconds)] = math.inf
    if (seconds < 0).any():
        raise ValueError(f"negative time {seconds.min():.3g} s")
    seconds = np.maximum(seconds, floor)
    best = seconds.min(axis=1, keepdims=True, initial=math.inf)
    with np.errstate(invalid="ignore"):
        quotient = np.where(np.isinf(seconds), math.inf, seconds / best)
    return pd.DataFrame(quotient, index=times.index, columns=times.columns)


def performance_profile(times: pd.DataFrame, problems: int | None = None, floor: float = FLOOR) -> Profile:
    """The profile of times [s], problems × labels, ∞ or NaN for a failure.

    Parameters
    ----------
    problems : N, when more problems were planned than the table has rows. Raises ValueError when fewer.
    floor : shorter times count as this [s]; does not touch the other problems.

    >>> times = pd.DataFrame({"fast": [1.0, 1.0, math.inf], "slow": [4.0, 1.0, 8.0]}, index=["p", "q", "r"])
    >>> fast, slow = performance_profile(times).curves
    >>> [round(fast.at(tau), 2) for tau in (1, 2, 4, math.inf)]
    [0.67, 0.67, 0.67, 0.67]
    >>> [round(slow.at(tau), 2) for tau in (1, 2, 4, math.inf)]
    [0.67, 0.67, 1.0, 1.0]
    """
    planned = len(times) if problems is None else problems
    if planned < len(times):
        raise ValueError(f"{planned} problems planned, but the table has {len(times)}")
    quotient = ratios(times, floor)
    labels: Sequence[str] = sorted(quotient.columns)
    curves = [_curve(label, quotient[label].to_numpy(dtype=float), planned) for label in labels]
    return Profile(tuple(curves), planned, floor)


def reversals(
    times: pd.DataFrame, labels: Sequence[str], tau: float = 2.0, floor: float = FLOOR
) -> list[tuple[str, str]]:
    """Pairs (a, b) of `labels` with a above b at τ in the profile of all solvers, and below b when the two are alone.

    A profile ranks against the best of all, so that a third solver may decide between two others (Gould and Scott,
    ACM TOMS 43, 2016).

    >>> times = pd.DataFrame({"a": [1, 1, 1, 1, 1, 1, 1, 5, 5, 5], "b": [2.5, 2.5, 2.5, 9, 9, 9, 9, 1, 1, 1],
    ...                       "c": [6, 6, 6, 2, 2, 2, 2, 2.5, 2.5, 2.5]})
    >>> reversals(times, ["a", "b", "c"])
    [('c', 'b')]
    """
    together = {c.label: c.at(tau) for c in performance_profile(times, floor=floor).curves}
    found: list[tuple[str, str]] = []
    for one, other in combinations(sorted(labels, key=lambda label: (-together[label], label)), 2):
        alone = {c.label: c.at(tau) for c in performance_profile(times[[one, other]], floor=floor).curves}
        if together[one] > together[other] and alone[one] < alone[other]:
            found.append((one, other))
    return found


def _curve(label: str, quotients: Floats, problems: int) -> Curve:
    found, count = np.unique(quotients[np.isfinite(quotients)], return_counts=True)
    return Curve(label, found, tuple(int(k) for k in np.cumsum(count)), problems)
