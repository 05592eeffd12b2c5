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


def profile_of_two(
    values: pd.DataFrame, one: str, other: str, problems: int | None = None, floor: float | None = FLOOR
) -> Profile:
    """Return the performance profile of two labels alone, over all problems.

    >>> values = pd.DataFrame({"a": [9.0, 9.0], "b": [2.0, 1.0], "c": [1.0, 2.0]})
    >>> [curve.at(1.0) for curve in profile_of_two(values, "a", "b").curves]
    [0.0, 1.0]
    """
    return performance_profile(values[[one, other]], at_least(values, problems), floor)


def record(values: pd.DataFrame, one: str, other: str, floor: float | None = FLOOR) -> tuple[int, int, int]:
    """Count on how many problems one label is ahead, the other is, and both cost the same down to the floor.

    A label is ahead that costs less, or solves what the other does not.

    >>> inf = float("inf")
    >>> record(pd.DataFrame({"a": [1.0, 1.0, inf, 5.0], "b": [2.0, 1.0, inf, inf]}), "a", "b")
    (2, 0, 1)
    """
    mine, theirs = costs(values[[one, other]], floor).T
    ties = (mine == theirs) & np.isfinite(mine)
    return int((mine < theirs).sum()), int((mine > theirs).sum()), int(ties.sum())


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
