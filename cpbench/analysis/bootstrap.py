"""Bootstrap intervals that resample families: how much of a figure is the choice of problems.

Time steps of one scene resemble each other, so that a hundred of them say little more than one. Resampling problems
one by one takes them for a hundred witnesses and gives intervals that are too narrow; here whole families are drawn
with replacement (the cluster bootstrap, Davison and Hinkley 1997, §3.8; Cameron, Gelbach and Miller 2008). A problem
without a family is one by itself, so that without families this is the ordinary bootstrap.

Every statistic here is a function of a quotient of sums over problems,

    θ = g( Σ_p a_p / Σ_p b_p ),        θ* = g( Σ_f m_f A_f / Σ_f m_f B_f ),

with A_f, B_f the sums over family f and m_f how often it was drawn: one product of the matrix of multiplicities
(replicates × families) and the sums per family gives all replicates. All labels share the replicates.

With few families the percentiles of the replicates lie too close together; the *expanded* ones (`tail`) correct
that for a mean. On planted log-normal times, 10 problems a family, 1000 trials, intervals of 95 % held the truth in

    families                    3      4      5     10     20     40
    expanded                 75 %   88 %   92 %   95 %   94 %   95 %
    percentile               75 %   81 %   83 %   90 %   92 %   94 %
    problem by problem       44 %   46 %   47 %   50 %   47 %   47 %

so below FEW families they are a guess, and callers print the number. What no problem showed (a failure, where all 45
were solved) no resampling shows either.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from statistics import NormalDist
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from cpbench.analysis.means import Array, logged, unlogged, values

FEW = 5
"""With fewer families an interval is a rough guess."""
REPLICATES = 1000
CELLS = 2**21
"""Entries of the arrays that are worked on at a time: bounds the memory, and changes no number."""


def families_of(group: pd.DataFrame) -> pd.Series[str]:
    """Return the family of each problem of a group, by fingerprint; of a problem in two families the first by name."""
    pairs = group[["fingerprint", "family"]].drop_duplicates().sort_values(["fingerprint", "family"])
    return pairs.drop_duplicates("fingerprint").set_index("fingerprint")["family"]


def clusters(problems: pd.Index[Any], families: pd.Series[str] | None = None) -> tuple[npt.NDArray[np.intp], int]:
    """Give the cluster of each problem a number, and count them; a problem without a family (missing, '') is its own
    cluster.

    >>> clusters(pd.Index(["p", "q", "r", "s"]), pd.Series({"p": "x", "r": "x", "s": ""}))
    (array([0, 1, 0, 2]), 3)
    """
    if families is None:
        return np.arange(len(problems)), len(problems)
    name = families.reindex(problems)
    alone = (name.isna() | (name == "")).to_numpy()
    codes = np.empty(len(problems), dtype=np.intp)
    codes[~alone], distinct = pd.factorize(name.to_numpy()[~alone], sort=True)
    codes[alone] = len(distinct) + np.arange(alone.sum())
    return codes, len(distinct) + int(alone.sum())


def mean_time(
    matrix: pd.DataFrame,
    shift: float,
    charge: float,
    lost: pd.DataFrame | None = None,
    families: pd.Series[str] | None = None,
    **given: Any,
) -> pd.DataFrame:
    """Return the shifted geometric mean [s] of each label over all problems with its interval (`intervals`, which takes
    what else is `given`), a failure charged `charge` [s] (see `means`), the shift fixed. `lost` : pairs that are left
    out (`table.lost`).

    >>> times = pd.DataFrame({"a": [1.0, 2.0, 4.0, 8.0, math.inf, 1.0]}, index=list("pqrstu"))
    >>> found = mean_time(times, 0.0, 16.0, families=pd.Series({"p": "x", "q": "x"}), expanded=False)
    >>> found.loc["a"].round(2).tolist()
    [3.17, 1.49, 9.19]
    """
    seconds = values(matrix)
    counted = np.ones(matrix.shape, dtype=bool)
    if lost is not None:
        counted = ~lost.loc[matrix.index, matrix.columns].to_numpy(dtype=bool)
    top = np.where(counted, logged(np.where(np.isfinite(seconds), seconds, charge), shift), 0.0)
    clustered = clusters(matrix.index, families)
    estimates = intervals(top, counted, clustered, lambda x: unlogged(x, shift), **given)
    return estimates.set_axis(pd.Index([str(label) for label in matrix.columns], name="label"))


def intervals(
    top: Array,
    bottom: npt.NDArray[Any],
    clustered: tuple[npt.NDArray[np.intp], int],
    of: Callable[[Array], Array] = lambda x: x,
    *,
    level: float = 0.95,
    replicates: int = REPLICATES,
    seed: int = 0,
    expanded: bool = True,
) -> pd.DataFrame:
    """Return g(Σ a / Σ b) of each label: `estimate`, and the ends `low` and `high` of its interval; with one family
    there is none (NaN).

    Parameters
    ----------
    top, bottom : a and b, problems × labels; a statistic that is not defined has NaN in `top`. clustered : of
    `clusters`. of : g. expanded : whether the percentiles are read further out, as Student's t asks with so many
    families.
    """
    codes, count = clustered
    top, bottom = _by_family(top, codes, count), _by_family(bottom.astype(float), codes, count)
    labels = top.shape[1]
    drawn, ends = np.empty((replicates, labels)), np.full((2, labels), math.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        for start, weights in multiplicities(count, replicates, seed):
            drawn[start : start + len(weights)] = of((weights @ top) / (weights @ bottom))
        estimate = of(top.sum(axis=0) / bottom.sum(axis=0))
    carrying = (bottom > 0).sum(axis=0)
    for k in np.flatnonzero(np.isfinite(estimate) & (carrying > 1)):
        sample = drawn[np.isfinite(drawn[:, k]), k]  # what drew nothing that counts has no value
        beyond = tail(level, int(carrying[k]) if expanded else 0)
        ends[:, k] = np.quantile(sample, (beyond, 1 - beyond))
    return pd.DataFrame({"estimate": estimate, "low": ends[0], "high": ends[1]})


def tail(level: float, families: int) -> float:
    """Return the share of replicates beyond each end: Φ(√(F/(F − 1)) t_{F−1}) in place of (1 − level)/2, where F is
    given.

    The spread of replicates is √((F − 1)/F) of what it should be, and of F values; both as Hesterberg, The American
    Statistician 69 (2015), §4.3, corrects it for an ordinary mean.
    """
    plain = (1 - level) / 2
    if families < 2:
        return plain
    from scipy.special import stdtrit  # takes a tenth of a second

    return NormalDist().cdf(math.sqrt(families / (families - 1)) * float(stdtrit(families - 1, plain)))


def multiplicities(count: int, replicates: int, seed: int) -> Iterator[tuple[int, Array]]:
    """Yield how often each family was drawn, replicates × families, in blocks with the number of their first
    replicate.
    """
    rng = np.random.default_rng(seed)
    block = max(1, CELLS // max(1, count))
    for start in range(0, replicates if count else 0, block):
        rows = min(block, replicates - start)
        chosen = rng.integers(count, size=(rows, count)) + count * np.arange(rows)[:, None]
        yield start, np.bincount(chosen.ravel(), minlength=rows * count).reshape(rows, count).astype(float)


def _by_family(array: Array, codes: npt.NDArray[np.intp], count: int) -> Array:
    """Sum over the problems of each family, families × labels."""
    if not count:
        return np.zeros((0, array.shape[1]))
    order = np.argsort(codes, kind="stable")
    return np.add.reduceat(array[order], np.searchsorted(codes[order], np.arange(count)), axis=0)
