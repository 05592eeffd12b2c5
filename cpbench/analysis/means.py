"""Means of times in which a failure costs something: what was charged, and over what.

    SGM(t; s) = exp( (1/N) Σ_p log(t_p + s) ) − s = s · expm1( (1/N) Σ_p log1p(t_p / s) )

is the shifted geometric mean of Mittelmann's benchmarks. It needs two choices that the data do not make: the shift s
(far above the times it is the arithmetic mean, which one failure decides; far below, the tiniest times decide) and
what a problem not solved is charged: the time limit, and never less than the slowest answer of the table, so that a
false claim cannot be ahead of a slow answer. Both are part of every result.

A matrix holds times [s], problems × labels, ∞ or NaN where the pair is not verified as solved; it has a row for each
of the N planned problems.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import pandas as pd

from cpbench.analysis.profiles import FLOOR, ratios

Array: TypeAlias = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Means:
    """The means of a table and all that they depend on.

    Attributes
    ----------
    mean : [s], by label (sorted); NaN where nothing was solved, or a failure would have to be charged and there is no
        limit.
    problems : how many it was taken over. shift, charge : in seconds, NaN where there is none.
    """

    mean: pd.Series[float]
    problems: int
    shift: float
    charge: float


def values(matrix: pd.DataFrame) -> Array:
    """Copy the matrix as an array with ∞ for NaN. Raises ValueError on a negative value."""
    result = matrix.to_numpy(dtype=float, copy=True)
    result[np.isnan(result)] = math.inf
    if (result < 0).any():
        raise ValueError(f"negative value {result.min():.3g} in a table of times")
    return result


def default_shift(times: pd.DataFrame) -> float:
    """Return the median [s] of all finite times, 0 when there is none: the shift that suits these data.

    >>> default_shift(pd.DataFrame({"a": [1.0, 3.0], "b": [2.0, math.inf]}))
    2.0
    """
    finite = times.to_numpy(dtype=float)
    finite = finite[np.isfinite(finite)]
    return float(np.median(finite)) if finite.size else 0.0


def charge(times: pd.DataFrame, limit: float) -> float:
    """Return the seconds that a failure costs in a table: the time limit, but no less than the slowest answer; NaN
    where there was none.

    >>> charge(pd.DataFrame({"a": [1.0, math.inf], "b": [10.5, 2.0]}), limit=10.0)
    10.5
    """
    if not math.isfinite(limit):
        return math.nan
    finite = times.to_numpy(dtype=float)
    return float(finite.max(initial=limit, where=np.isfinite(finite)))


def logged(seconds: npt.ArrayLike, shift: float) -> Array:
    """Return log1p(t / s), or log t where s = 0: a shifted geometric mean is the average of these."""
    given = np.asarray(seconds, dtype=float)
    with np.errstate(divide="ignore"):
        return np.log(given) if shift == 0 else np.log1p(given / shift)


def unlogged(average: npt.ArrayLike, shift: float) -> Array:
    """Invert `logged` [s]; exact also where the times are far below the shift."""
    given = np.asarray(average, dtype=float)
    return np.exp(given) if shift == 0 else shift * np.expm1(given)


def commonly_solved(matrix: pd.DataFrame, labels: Sequence[str] | None = None) -> pd.Index[Any]:
    """Return the problems that each of the labels (default: all) solves.

    >>> list(commonly_solved(pd.DataFrame({"a": [1.0, 2.0], "b": [3.0, math.inf]}, index=["p", "q"])))
    ['p']
    """
    chosen = matrix if labels is None else matrix[list(labels)]
    return matrix.index[np.isfinite(chosen.to_numpy(dtype=float)).all(axis=1)]


def means(
    matrix: pd.DataFrame,
    *,
    shift: float | None = None,
    limit: float = math.inf,
    common: Sequence[str] | None = None,
    lost: pd.DataFrame | None = None,
) -> Means:
    """Compute the shifted geometric mean time of each label over all problems of the matrix or over those commonly
    solved.

    Parameters
    ----------
    shift : seconds; default the median of all finite times of the matrix.
    limit : the time limit [s] that a failure is charged; ∞ where there was none. A label that did not solve everything
        has no mean then (NaN).
    common : labels; the means are theirs, over the problems that each of them solves.
    lost : whether a conversion lost the answer of a pair (`table.lost`): the mean of its label is over the others.

    >>> times = pd.DataFrame({"a": [1.0, 4.0], "b": [2.0, math.inf]})
    >>> means(times, shift=0.0, limit=8.0).mean.round(12).to_dict()
    {'a': 2.0, 'b': 4.0}
    >>> means(times, shift=0.0).mean.round(12).to_dict()
    {'a': 2.0, 'b': nan}
    >>> (found := means(times, shift=0.0, common=["a", "b"])).mean.to_dict(), found.problems
    ({'a': 1.0, 'b': 2.0}, 1)
    """
    shift, cost = default_shift(matrix) if shift is None else shift, charge(matrix, limit)
    whole = matrix if common is None else matrix.loc[commonly_solved(matrix, common), list(common)]
    whole = whole[sorted(whole.columns)]
    seconds = values(whole)
    done = np.isfinite(seconds)
    without = np.zeros(len(whole.columns), dtype=int)
    if lost is not None:
        without = lost.reindex(index=whole.index, columns=whole.columns, fill_value=False).to_numpy().sum(axis=0)
    failed = (~done).sum(axis=0) - without
    rows = len(whole) - without
    logs = np.where(done, logged(np.where(done, seconds, 1.0), shift), 0.0).sum(axis=0)
    logs = logs + np.where(failed, failed * logged(cost, shift), 0.0)
    averages = unlogged(logs / np.where(rows > 0, rows, math.nan), shift)
    averages[(failed > 0) & math.isnan(cost) | ~done.any()] = math.nan
    labels = pd.Index([str(label) for label in whole.columns], name="label")
    return Means(pd.Series(averages, labels, dtype=float), len(whole), shift, cost)


# ----------------------------------------------------------------------------------------------------- the virtual best
# The virtual best: a solver that takes, for each problem, whichever label was fastest; and which labels it needs.
#
#     t*_p = min_s t[p, s],        gap of s on p: t[p, s] / t*_p ≥ 1,        without s: t*_p(−s) = min_{k ≠ s} t[p, k]
#
# No choice does better than t* by choosing among these labels, and a label that is slow on the whole may still be the
# one that the choice needs: its *marginal contribution* is what the virtual best loses without it (Xu, Hutter, Hoos and
# Leyton-Brown, SAT 2012). A matrix holds times [s], problems × labels, ∞ or NaN where the pair is not verified.

WITHIN = 2.0
"""Not more than this many times the virtual best is near to it."""


def gaps(times: pd.DataFrame, floor: float = FLOOR, lost: pd.DataFrame | None = None) -> pd.DataFrame:
    """Compare each label with the virtual best of all, one row a label (sorted).

    Columns, N being the rows of the matrix without those of which a conversion `lost` the answer (`table.lost`):
    planned (N), solved, fastest (where it shares the lead), within (fraction of the N within WITHIN times the best);
    median and mean (geometric) of its ratio to the best over the problems that it solved, NaN without any;
    alone (problems that only it solves) and marginal (factor by which the virtual best is slower without it, geometric
    mean over the problems that others solve too; 1 says that it is never missed).

    >>> times = pd.DataFrame({"a": [1.0, 1.0, math.inf], "b": [4.0, 1.0, 2.0]})
    >>> gaps(times)[["solved", "fastest", "within", "mean", "alone", "marginal"]].round(2).to_numpy().tolist()
    [[2.0, 2.0, 0.67, 1.0, 0.0, 1.59], [3.0, 2.0, 0.67, 1.59, 1.0, 1.0]]
    """
    ordered = times[sorted(times.columns)]
    labels = pd.Index([str(label) for label in ordered.columns], name="label")
    ratio = ratios(ordered, floor).to_numpy()
    done = np.isfinite(ratio)
    without = 0 if lost is None else lost.reindex(columns=ordered.columns, fill_value=False).sum().to_numpy(dtype=int)
    planned = np.broadcast_to(len(times) - without, (len(labels),))
    alone, marginal = _marginal(np.maximum(values(ordered), floor))
    return pd.DataFrame(
        {
            "planned": planned,
            "solved": done.sum(axis=0),
            "fastest": (ratio <= 1.0).sum(axis=0),
            "within": (ratio <= WITHIN).sum(axis=0) / np.where(planned > 0, planned, math.nan),
            "median": pd.DataFrame(np.where(done, ratio, math.nan)).median().to_numpy(),
            "mean": _log_mean(ratio, done),
            "alone": alone,
            "marginal": marginal,
        },
        index=labels,
    )


def _marginal(seconds: Array) -> tuple[Array, Array]:
    """Count by label the problems that no other label solves, and how much slower the others' best is on those it
    leads.
    """
    problems, labels = seconds.shape
    if labels < 2 or not problems:
        return np.isfinite(seconds).sum(axis=0), np.full(labels, math.nan)
    two = np.partition(seconds, 1, axis=1)[:, :2]
    first, second = two[:, [0]], two[:, [1]]
    leading = seconds == first
    alone = leading & np.isfinite(first) & np.isinf(second)
    slower = np.divide(second, first, out=np.ones_like(first), where=np.isfinite(second))
    return alone.sum(axis=0), _log_mean(np.where(leading, slower, 1.0), np.isfinite(first) & ~alone)


def _log_mean(ratio: Array, where: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> Array:
    """Return the geometric mean of the chosen entries of each column, NaN of none."""
    count = where.sum(axis=0)
    total = np.log(np.where(where, ratio, 1.0)).sum(axis=0)
    return np.exp(np.divide(total, count, out=np.full(len(count), math.nan), where=count > 0))
