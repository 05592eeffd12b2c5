"""Order of the solvers of a ranking: by what they solved where that differs significantly, else by time.

Two solvers were given the same problems, so that only the problems count which one of them solves and the other does
not, b and c of them. If both solve equally well, each of these is as likely to be of the one as of the other, and

    p = min(1, 2 P(X ≤ min(b, c))),    X ~ binomial(b + c, 1/2)

is the exact test of McNemar (Psychometrika 12, 1947). It takes problems for independent. Steps of one scene are not, so
that the true p is larger, and a difference that the test finds significant may still be one of few scenes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd

from cpbench.analysis import means
from cpbench.analysis import table as rows_of
from cpbench.analysis.profiles import FLOOR
from cpbench.verification import Status

LEVEL = 0.05
"""Two numbers of solved problems differ where the test gives less than this."""


def mcnemar(one: int, other: int) -> float:
    """Return p of the exact test, two-sided, of two solvers of which each alone solves so many problems.

    >>> mcnemar(1, 0), mcnemar(5, 0), mcnemar(6, 0), mcnemar(3, 3)
    (1.0, 0.0625, 0.03125, 1.0)
    """
    from scipy.special import bdtr  # takes a tenth of a second

    return min(1.0, 2.0 * float(bdtr(min(one, other), one + other, 0.5))) if one + other else 1.0


def tiers(solved: pd.DataFrame) -> list[list[str]]:
    """Split labels into tiers: the one that solves most, with all that do not differ significantly from it; then the
    same of the others. A label that solves nothing is in the last tier.

    `solved` : problems × labels.

    >>> solved = pd.DataFrame({"a": [True] * 10, "b": [True] * 9 + [False], "c": [True] * 4 + [False] * 6, "d": False})
    >>> tiers(solved)
    [['a', 'b'], ['c'], ['d']]
    """
    counts = solved.sum()
    left = sorted((str(label) for label in solved), key=lambda label: (-int(counts[label]), label))
    none = [label for label in left if not counts[label]]
    left = left[: len(left) - len(none)]
    groups: list[list[str]] = []
    while left:
        first = solved[left[0]]
        with_first = [
            label
            for label in left
            if mcnemar(int((first & ~solved[label]).sum()), int((solved[label] & ~first).sum())) >= LEVEL
        ]
        groups.append(with_first)
        left = [label for label in left if label not in with_first]
    return [*groups, none] if none else groups


def mean_times(rows: pd.DataFrame, times: pd.DataFrame) -> Mapping[str, float]:
    """Return the geometric mean time of each label over all problems [s], by which a tier is ordered; ∞ for labels
    without a time that may be compared. NaN for all where no limit is known.

    A problem that is not solved is charged the time limit, or the slowest answer where that took longer. A stationary
    point, which may be no minimum, is charged the slowest answer.

    `times` : of the solved rows whose times may be compared [s], problems × labels.
    """
    seconds = np.maximum(means.values(times), FLOOR)
    finite = np.isfinite(seconds)
    limit = means.charge(times, rows_of.limit(rows))
    slowest = float(seconds.max(initial=FLOOR, where=finite))
    stationary = rows_of.spread(rows, (rows["status"] == str(Status.STATIONARY)).to_numpy(), False)
    stationary_at = stationary.reindex(index=times.index, columns=times.columns, fill_value=False).to_numpy(dtype=bool)
    charged = np.where(finite, seconds, np.where(stationary_at, slowest, max(limit, FLOOR)))
    average = np.exp(np.log(charged).mean(axis=0)) if len(charged) else np.full(charged.shape[1], math.nan)
    by_label = dict(zip((str(label) for label in times), average.tolist(), strict=True))
    if math.isnan(limit):
        return dict.fromkeys((str(label) for label in rows["label"].unique()), math.nan)
    return {str(label): by_label.get(str(label), math.inf) for label in rows["label"].unique()}


def order(rows: pd.DataFrame, times: pd.DataFrame, factors: Mapping[str, float]) -> list[str]:
    """Return the labels of some rows, the best first: tiers by what is solved, each in order of `mean_times`.

    Where no limit is known, there is nothing to charge, and a tier is in order of what was solved. Equal labels are in
    order of what they solved, of their stationary points, of `factors` (time over that of the fastest) and of name.
    """
    solved = rows_of.spread(rows, rows_of.solved(rows).to_numpy(), False)
    counts, cost = solved.sum(), mean_times(rows, times)
    stationary = rows.loc[rows["status"] == str(Status.STATIONARY), "label"].value_counts()

    def key(label: str) -> tuple[float, int, int, float, str]:
        average, factor = cost[label], factors.get(label, math.nan)
        return (
            0.0 if math.isnan(average) else average,
            -int(counts[label]),
            -int(stationary.get(label, 0)),
            math.inf if math.isnan(factor) else factor,
            label,
        )

    return [label for tier in tiers(solved) for label in sorted(tier, key=key)]
