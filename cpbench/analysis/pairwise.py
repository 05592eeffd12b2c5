"""Solvers two by two, and what a third one does to their order.

A performance profile measures each solver against the best of all that are shown. The highest curve at τ is the best
solver there, but the order of the others is an order with respect to that best one: take it away and they may change
places (Gould and Scott, A Note on Performance Profiles for Benchmarking Software, ACM TOMS 43(2), 2016). Two solvers
are compared by their own profile alone, and by how often each is ahead of the other.

Values are costs, problems × labels, ∞ or NaN for a failure, as `profiles` takes them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from itertools import pairwise as successive

import numpy as np
import pandas as pd

from cpbench.analysis.profiles import FLOOR, Profile, at_least, costs, performance_profile

ALL = ""
"""The column of `leave_one_out` in which no label is left out."""
RECORDS = ("one", "other", "wins", "ties", "losses", "neither")


def profile_of_two(
    values: pd.DataFrame, one: str, other: str, problems: int | None = None, floor: float | None = FLOOR
) -> Profile:
    """Return the performance profile of two labels alone, over all problems.

    >>> values = pd.DataFrame({"a": [9.0, 9.0], "b": [2.0, 1.0], "c": [1.0, 2.0]})
    >>> [curve.at(1.0) for curve in profile_of_two(values, "a", "b").curves]
    [0.0, 1.0]
    """
    return performance_profile(values[[one, other]], at_least(values, problems), floor)


def records(values: pd.DataFrame, problems: int | None = None, floor: float | None = FLOOR) -> pd.DataFrame:
    """Count how often each of two labels is ahead, one row a pair in order of label: RECORDS.

    `wins` and `losses` are those of `one`: it costs less, or solves what the other does not. `ties` cost the same
    down to the floor; on `neither` no one of the two solves the problem. The four add up to N.

    >>> records(pd.DataFrame({"a": [1.0, 1.0, math.inf, 5.0], "b": [2.0, 1.0, math.inf, math.inf]})).to_dict("records")
    [{'one': 'a', 'other': 'b', 'wins': 2, 'ties': 1, 'losses': 0, 'neither': 1}]
    """
    planned, labels = at_least(values, problems), sorted(values.columns)
    cost = np.ascontiguousarray(costs(values[labels], floor).T)
    rows: list[tuple[object, ...]] = []
    for k, one in enumerate(labels):
        mine, theirs = cost[k], cost[k + 1 :]
        wins, losses = (mine < theirs).sum(axis=1), (mine > theirs).sum(axis=1)
        ties = ((mine == theirs) & np.isfinite(mine)).sum(axis=1)
        for j, other in enumerate(labels[k + 1 :]):
            counts = int(wins[j]), int(ties[j]), int(losses[j])
            rows.append((one, other, *counts, planned - sum(counts)))
    return pd.DataFrame(rows, columns=list(RECORDS))


def leave_one_out(
    values: pd.DataFrame, tau: float = 2.0, problems: int | None = None, floor: float | None = FLOOR
) -> pd.DataFrame:
    """Return ρ(τ) of each label with all labels shown (column ALL), and with each one left out (its column); NaN for
    itself.

    Rows are in the order with all, highest first, ties by label. Columns after ALL are in the order of the rows.

    >>> values = pd.DataFrame({"a": [1.0, 1.0], "b": [2.5, 9.0], "c": [6.0, 2.0]})
    >>> leave_one_out(values)[[ALL, "a"]].to_dict("index")
    {'a': {'': 1.0, 'a': nan}, 'c': {'': 0.5, 'a': 0.5}, 'b': {'': 0.0, 'a': 0.5}}
    """
    planned, labels = at_least(values, problems), sorted(values.columns)
    cost = costs(values[labels], floor)
    heights = {ALL: _heights(cost, tau, planned)}
    for k, label in enumerate(labels):
        rest = cost.copy()
        rest[:, k] = math.inf
        height = _heights(rest, tau, planned)
        height[k] = math.nan
        heights[label] = height
    table = pd.DataFrame(heights, index=labels)
    order = sorted(labels, key=lambda label: (-float(table.at[label, ALL]), label))
    return table.loc[order, [ALL, *order]]


@dataclass(frozen=True)
class Flip:
    """Two neighbours in the order with all labels that change places when `without` is left out.

    `together` are ρ(τ) of `above` and `below` with all, `apart` without that label.
    """

    above: str
    below: str
    without: str
    together: tuple[float, float]
    apart: tuple[float, float]


def flips(table: pd.DataFrame) -> list[Flip]:
    """Find every adjacent pair of `leave_one_out` whose strict order is reversed by leaving a third label out.

    >>> values = pd.DataFrame({"a": [1] * 7 + [5] * 3, "b": [2.5] * 3 + [9] * 4 + [1] * 3,
    ...                        "c": [6] * 3 + [2] * 4 + [2.5] * 3})
    >>> flips(leave_one_out(values))
    [Flip(above='c', below='b', without='a', together=(0.4, 0.3), apart=(0.4, 0.6))]
    """
    found: list[Flip] = []
    order = list(table.index)
    for above, below in successive(order):
        together = float(table.at[above, ALL]), float(table.at[below, ALL])
        for without in order:
            apart = float(table.at[above, without]), float(table.at[below, without])
            if together[0] > together[1] and apart[0] < apart[1]:
                found.append(Flip(above, below, without, together, apart))
    return found


def reversals(
    values: pd.DataFrame, labels: Sequence[str], tau: float = 2.0, floor: float | None = FLOOR
) -> list[tuple[str, str]]:
    """Find pairs (a, b) of `labels` with a above b at τ in the profile of all solvers, and below b when the two are
    alone.

    >>> values = pd.DataFrame({"a": [1] * 7 + [5] * 3, "b": [2.5] * 3 + [9] * 4 + [1] * 3,
    ...                        "c": [6] * 3 + [2] * 4 + [2.5] * 3})
    >>> reversals(values, ["a", "b", "c"])
    [('c', 'b')]
    """
    together = {c.label: c.at(tau) for c in performance_profile(values, floor=floor).curves}
    found: list[tuple[str, str]] = []
    for one, other in combinations(sorted(labels, key=lambda label: (-together[label], label)), 2):
        alone = {c.label: c.at(tau) for c in profile_of_two(values, one, other, floor=floor).curves}
        if together[one] > together[other] and alone[one] < alone[other]:
            found.append((one, other))
    return found


def _heights(
    cost: np.ndarray[tuple[int, int], np.dtype[np.float64]], tau: float, planned: int
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return ρ(τ) of each column: the ratios are those of `profiles.ratios`, but no curve is made."""
    best = cost.min(axis=1, keepdims=True, initial=math.inf)
    with np.errstate(invalid="ignore"):
        return ((cost / best <= tau) & np.isfinite(cost)).sum(axis=0) / max(planned, 1)
