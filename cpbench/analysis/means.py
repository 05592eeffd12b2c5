"""Means of times in which a failure costs something: what was charged, and over what.

    SGM(t; s) = exp( (1/N) Σ_p log(t_p + s) ) − s = s · expm1( (1/N) Σ_p log1p(t_p / s) )

is the shifted geometric mean of Mittelmann's benchmarks. It needs two choices that the data do not make: the shift s
(far above the times it is the arithmetic mean, which one failure decides; far below, the tiniest times decide) and
the penalty that a problem not solved is charged (the time limit; 2 or 10 times it: PAR2, PAR10, as in the SAT
competitions; or seconds). Both are arguments here and part of every result, and a failure is never charged less than
the slowest answer of the table: a false claim cannot be ahead of a slow answer.

A matrix holds times [s], problems × labels, ∞ or NaN where the pair is not verified as solved; it has a row for each
of the N planned problems.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt
import pandas as pd

Array: TypeAlias = npt.NDArray[np.float64]
Kind: TypeAlias = Literal["geometric", "arithmetic", "median"]

SMALL = 10
"""A mean over fewer commonly solved problems than this is about those problems only."""


@dataclass(frozen=True)
class Penalty:
    """Cost of a problem that was not solved: `factor` times the time limit or, where given, `seconds`.

    >>> str(LIMIT), str(PAR10), str(Penalty(seconds=100.0))
    ('limit', 'PAR10', '100 s')
    """

    factor: float = 1.0
    seconds: float | None = None

    def seconds_at(self, limit: float) -> float:
        """Return seconds under a time limit [s]; NaN where there is none to multiply.

        >>> PAR2.seconds_at(10.0), PAR2.seconds_at(math.inf), Penalty(seconds=100.0).seconds_at(math.inf)
        (20.0, nan, 100.0)
        """
        cost = self.factor * limit if self.seconds is None else self.seconds
        return cost if math.isfinite(cost) else math.nan

    def __str__(self) -> str:
        if self.seconds is not None:
            return f"{self.seconds:g} s"
        return "limit" if self.factor == 1.0 else f"PAR{self.factor:g}"


LIMIT, PAR2, PAR10 = Penalty(), Penalty(2.0), Penalty(10.0)


@dataclass(frozen=True)
class Means:
    """The means of a table and all that they depend on.

    Attributes
    ----------
    table : by label (sorted): `planned`, `solved`, `charged`, `lost` (problems; planned is the sum of the others),
        `mean` [s], `reason` (why it is NaN, or '').
    problems : how many it was taken over. shift, charge : in seconds, NaN where there is none.
    remark : what a reader has to know of the set of problems or of the charge, or ''.
    """

    table: pd.DataFrame
    problems: int
    shift: float
    charge: float
    remark: str


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


def charge(times: pd.DataFrame, penalty: Penalty, limit: float) -> float:
    """Return the seconds that a failure costs in a table: the penalty, but no less than the slowest answer; NaN
    without either.

    >>> charge(pd.DataFrame({"a": [1.0, math.inf], "b": [10.5, 2.0]}), LIMIT, limit=10.0)
    10.5
    """
    penalty_seconds = penalty.seconds_at(limit)
    finite = times.to_numpy(dtype=float)
    return (
        penalty_seconds
        if math.isnan(penalty_seconds)
        else float(finite.max(initial=penalty_seconds, where=np.isfinite(finite)))
    )


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
    penalty: Penalty = LIMIT,
    limit: float = math.inf,
    kind: Kind = "geometric",
    common: Sequence[str] | None = None,
    lost: pd.DataFrame | None = None,
) -> Means:
    """Compute the mean time of each label over all problems of the matrix or over those commonly solved.

    Parameters
    ----------
    shift : seconds; default the median of all finite times of the matrix.
    limit : the time limit [s] that the penalty is a multiple of; ∞ where there was none. A label that did not solve
        everything has no mean then (NaN, with the reason).
    kind : 'geometric' (shifted), 'arithmetic', or 'median' (failures at ∞, without charge).
    common : labels; the means are theirs, over the problems that each of them solves.
    lost : whether a conversion lost the answer of a pair (`table.lost`): the mean of its label is over the others.

    >>> times = pd.DataFrame({"a": [1.0, 4.0], "b": [2.0, math.inf]})
    >>> means(times, shift=0.0, limit=8.0).table["mean"].round(12).to_dict()
    {'a': 2.0, 'b': 4.0}
    >>> means(times, shift=0.0).table.loc["b", "reason"]
    '1 of 2 not solved, and no limit to charge: give a penalty in seconds'
    >>> (found := means(times, shift=0.0, common=["a", "b"])).table["mean"].to_dict(), found.problems, found.remark
    ({'a': 1.0, 'b': 2.0}, 1, 'only 1 problem is solved by all 2 labels')
    """
    shift = default_shift(matrix) if shift is None else shift
    penalty_seconds, cost = penalty.seconds_at(limit), charge(matrix, penalty, limit)
    whole = matrix if common is None else matrix.loc[commonly_solved(matrix, common), list(common)]
    whole = whole[sorted(whole.columns)]
    seconds = values(whole)
    done = np.isfinite(seconds)
    without = _lost(whole, lost)
    failed = (~done).sum(axis=0) - without
    averages = _averages(seconds, failed, len(whole) - without, shift, cost, kind)
    reasons = [_reason(int(n), done, shift, cost, kind) for n in failed]
    averages[[bool(reason) for reason in reasons]] = math.nan
    table = pd.DataFrame(
        {
            "planned": len(whole),
            "solved": done.sum(axis=0),
            "charged": failed,
            "lost": without,
            "mean": averages,
            "reason": reasons,
        },
        index=pd.Index([str(label) for label in whole.columns], name="label"),
    )
    remark = (
        f"a failure is charged {cost:.3g} s, the slowest answer, not {penalty_seconds:.3g} s"
        if cost > penalty_seconds
        else ""
    )
    if common is not None and len(whole) < SMALL:
        count = {0: "no problem is", 1: "only 1 problem is"}.get(len(whole), f"only {len(whole)} problems are")
        remark = f"{count} solved by all {len(common)} labels"
    return Means(table, len(whole), shift, cost, remark)


def _lost(matrix: pd.DataFrame, lost: pd.DataFrame | None) -> npt.NDArray[np.int_]:
    """Count the lost answers of each label of a matrix."""
    if lost is None:
        return np.zeros(len(matrix.columns), dtype=int)
    return lost.reindex(index=matrix.index, columns=matrix.columns, fill_value=False).to_numpy(dtype=int).sum(axis=0)


def _averages(
    seconds: Array,
    failed: npt.NDArray[np.int_],
    counted: npt.NDArray[np.int_],
    shift: float,
    cost: float,
    kind: Kind,
) -> Array:
    """Average each column over so many problems as are `counted`, failures charged; NaN where there is no row or
    nothing to charge."""
    rows = np.where(counted > 0, counted, math.nan)
    if not len(seconds):
        return np.full(seconds.shape[1], math.nan)
    if kind == "median":  # lost ones are at the end, among the failures
        ordered = np.vstack([np.sort(seconds, axis=0), np.full(seconds.shape[1], math.inf)])
        places = np.arange(seconds.shape[1])
        return (ordered[np.maximum(counted - 1, 0) // 2, places] + ordered[counted // 2, places]) / 2
    finite = np.isfinite(seconds)
    if kind == "arithmetic":
        charged = np.where(failed, failed * cost, 0.0)
        return (np.where(finite, seconds, 0.0).sum(axis=0) + charged) / rows
    if not 0 <= shift < math.inf:
        return np.full(seconds.shape[1], math.nan)
    charged = np.where(failed, failed * logged(cost, shift), 0.0)
    logs = np.where(finite, logged(np.where(finite, seconds, 1.0), shift), 0.0)
    return unlogged((logs.sum(axis=0) + charged) / rows, shift)


def _reason(failed: int, done: npt.NDArray[np.bool_], shift: float, cost: float, kind: Kind) -> str:
    """Return why a label with so many failures has no mean, '' when it has one."""
    if not len(done):
        return "no problem to take a mean over"
    if not done.any():
        return "nothing was solved: there is no time to take a mean of"
    if kind == "geometric" and not 0 <= shift < math.inf:
        return f"a shift of {shift:g} s: must be finite and not negative"
    if kind != "median" and failed and math.isnan(cost):
        return f"{failed} of {len(done)} not solved, and no limit to charge: give a penalty in seconds"
    return ""
