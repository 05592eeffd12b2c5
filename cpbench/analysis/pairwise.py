"""Solvers two by two, and what a third one does to their order.

A performance profile measures each solver against the best of all that are shown. The highest curve at τ is the best
solver there, but the order of the others is an order with respect to that best one: take it away and they may change
places (Gould and Scott, A Note on Performance Profiles for Benchmarking Software, ACM TOMS 43(2), 2016). Two solvers
are compared by their own profile alone, and by how often each is ahead of the other.

Values are costs, problems × labels, ∞ or NaN for a failure, as `profiles` takes them.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
import pandas as pd

from cpbench.analysis.profiles import FLOOR, Profile, at_least, costs, performance_profile

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

    >>> inf = float("inf")
    >>> records(pd.DataFrame({"a": [1.0, 1.0, inf, 5.0], "b": [2.0, 1.0, inf, inf]})).to_dict("records")
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
    result: list[tuple[str, str]] = []
    for one, other in combinations(sorted(labels, key=lambda label: (-together[label], label)), 2):
        alone = {c.label: c.at(tau) for c in profile_of_two(values, one, other, floor=floor).curves}
        if together[one] > together[other] and alone[one] < alone[other]:
            result.append((one, other))
    return result
