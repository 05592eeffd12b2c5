"""Real-time statistics: how late a solver may be, how often it misses a deadline, and how good it is by then.

Of the times t of N problems (the steps of a simulation, say), failures being ∞ and staying among the N:

- The q-quantile is the least time within which at least a share q of the problems was solved, the inverse of the
  empirical distribution function (definition 1 of Hyndman and Fan, The American Statistician 50, 1996; numpy's
  `inverted_cdf`). It is a time that was measured, never a blend of a time and a failure, and it agrees with the
  misses: p99 ≤ D says that at most 1 % of the problems missed D.
- A miss is t > D. The interval of the share of misses is Wilson's (JASA 22, 1927), for independent problems; the steps
  of one simulation are not, and then it is too narrow.
- A run of misses are consecutive ones of a sequence in the order of its steps. A controller survives single misses,
  not runs of them (weakly hard deadlines: Bernat, Burns and Llamosí, IEEE Trans. Computers 50, 2001).
- The error at the deadline is the least measured one within D (`histories.error_at`).
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from cpbench.analysis import histories as paths
from cpbench.analysis import table as rows_of
from cpbench.analysis.reliability import wilson

COLUMNS = (
    "label", "problems", "solved", "p50", "p95", "p99", "max", "misses", "share", "low", "high", "longest",
    "longest_in", "longest_from", "error_p50", "error_p95", "error_max",
)  # fmt: skip
LEVELS = (0.5, 0.95, 0.99, 1.0)
"""Quantiles of the times; the last is the largest."""

Matrix: TypeAlias = np.ndarray[tuple[int, int], np.dtype[Any]]


def deadlines(
    group: pd.DataFrame, deadline: float, histories: pd.DataFrame | None = None, level: float = 0.95
) -> pd.DataFrame:
    """Return one row a label of a group, in order of label.

    Columns: problems (N, the same for all labels), solved (at all), p50, p95, p99 and max [s], misses of the deadline
    with their share and its interval (low, high), the longest run of consecutive misses within a sequence (`longest`,
    0 where no problem belongs to one) with the sequence it is in and the step it begins at ('' and NaN without any),
    and quantiles of the error at the deadline. Steps that were not planned do not break a run.

    Parameters
    ----------
    deadline : D [s], of convert + setup + solve + lift. Raises ValueError when it is not positive.
    histories : iterates of the rows; without them a pair has its answer alone.

    >>> rows = rows_of.normalised(pd.DataFrame({"problem": ["a", "b", "c"], "label": "s", "sequence": "walk",
    ...                                         "step": [0, 1, 2], "status": ["solved", "solved", "timeout"],
    ...                                         "solve": [1.0, 3.0, 9.0]}))
    >>> found = deadlines(rows, 2.0).iloc[0]
    >>> [found[name].item() for name in ("p50", "p95", "misses", "longest", "longest_from")]
    [3.0, inf, 2, 2, 1.0]
    """
    if not deadline > 0:
        raise ValueError(f"deadline of {deadline} s: must be positive")
    steps = steps_of(group)
    times = rows_of.times(group).reindex(steps.index)
    errors = paths.error_at(group, histories, deadline).reindex(steps.index)
    at, worst = quantiles(times).to_numpy(), quantiles(errors, (0.5, 0.95, 1.0)).to_numpy()
    solved = np.isfinite(times.to_numpy(dtype=float)).sum(axis=0)
    measured = {"problems": len(times), "solved": solved, **dict(zip(("p50", "p95", "p99", "max"), at, strict=True))}
    errors_at = dict(zip(("error_p50", "error_p95", "error_max"), worst, strict=True))
    return late(times, steps, deadline, level).assign(**measured, **errors_at)[list(COLUMNS)]


def quantiles(values: pd.DataFrame, levels: tuple[float, ...] = LEVELS) -> pd.DataFrame:
    """Return quantiles (rows, by level) of every column: the least value that a share q of all does not exceed; NaN
    is ∞.

    Raises ValueError for a level outside (0, 1]. NaN of no values.

    >>> quantiles(pd.DataFrame({"s": [4.0, 1.0, math.inf, 2.0]}), (0.5, 0.75, 0.76))["s"].tolist()
    [2.0, 4.0, inf]
    """
    for level in levels:
        if not 0.0 < level <= 1.0:
            raise ValueError(f"quantile {level:g} is not in (0, 1]")
    index = pd.Index(levels, name="level")
    if not len(values):
        return pd.DataFrame(math.nan, index=index, columns=values.columns)
    ordered = values.to_numpy(dtype=float, copy=True)
    ordered[np.isnan(ordered)] = math.inf
    ordered.sort(axis=0)
    # 0.07 · 100 is 7.000000000000001 in doubles, and the 7th value it is that has 7 % within
    places = [math.ceil(level * len(ordered) - 1e-9) - 1 for level in levels]
    return pd.DataFrame(ordered[places], index=index, columns=values.columns)


def steps_of(group: pd.DataFrame) -> pd.DataFrame:
    """Return sequence and step of each problem (index: fingerprint), in the order of both."""
    steps = group[["fingerprint", "sequence", "step"]].drop_duplicates("fingerprint").set_index("fingerprint")
    return steps.sort_values(["sequence", "step"], kind="stable")


def late(times: pd.DataFrame, steps: pd.DataFrame, deadline: float, level: float = 0.95) -> pd.DataFrame:
    """Return how often each label misses a deadline [s]: the columns label and misses to longest_from of `deadlines`.

    `times` : problems × labels [s], in the order of `steps` (`steps_of`).
    """
    missed = ~(times.to_numpy(dtype=float) <= deadline)
    misses = missed.sum(axis=0)
    low, high = wilson(misses, len(times), level)
    sequence = steps["sequence"].to_numpy(dtype=object)
    longest, end = _longest_runs(missed, sequence)
    there = longest > 0
    first = np.where(there, end - longest + 1, 0)
    return pd.DataFrame(
        {
            "label": times.columns.to_numpy(),
            "misses": misses,
            "share": misses / len(times),
            "low": low,
            "high": high,
            "longest": longest,
            "longest_in": np.where(there, sequence[first], ""),
            "longest_from": np.where(there, steps["step"].to_numpy(dtype=float)[first], math.nan),
        }
    )


def _longest_runs(missed: Matrix, sequence: np.ndarray[tuple[int], np.dtype[Any]]) -> tuple[Matrix, Matrix]:
    """Find in every column the length of the longest run of misses within a sequence, and the place where it ends.

    Rows are in the order of sequence and step. A run that ends at k began after the last place before k where there
    was no miss, or where the sequence began.
    """
    place = np.arange(len(missed))[:, None]
    begins = np.append(True, sequence[1:] != sequence[:-1])
    start = np.maximum.accumulate(np.where(begins, place[:, 0], 0))[:, None]
    hit = np.maximum.accumulate(np.where(missed, -1, place), axis=0)
    alone = (sequence == "")[:, None]
    length = np.where(missed & ~alone, place - np.maximum(hit, start - 1), 0)
    end = length.argmax(axis=0)
    return length[end, np.arange(missed.shape[1])], end
