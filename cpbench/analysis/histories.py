"""Error against time: what the iterates of a group's solves tell about every tolerance at once.

`histories` is a table with one row a judged iterate: `key` of the row it belongs to, `time` [s] since its solve began,
`share` of the recorded solve that was over, `iteration`, `residual` (the solver's own) and `error` (ours). Iterates
are kept at growing intervals, so that every time here is an upper bound.

With iterates k of pair (p, s), at t_k with error e_k (Moré and Wild, SIAM J. Optim. 20, 2009):

    t[p, s](ε) = min { t_k : e_k ≤ ε },      min ∅ = ∞
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of

COLUMNS = ("key", "time", "iteration", "residual", "error", "share")
ERRORS = tuple(float(f"{10.0 ** (-k / 4):.6e}") for k in range(57))
"""Quarter decades from 1 to 1e-14, whole ones exact."""
BEFORE = ("convert", "setup", "lift")
"""Parts of a solver's time besides its solve, of which the history has a share."""

Array: TypeAlias = np.ndarray[tuple[int], np.dtype[Any]]
Matrix: TypeAlias = np.ndarray[tuple[int, int], np.dtype[np.float64]]


def charged(rows: pd.DataFrame, histories: pd.DataFrame) -> pd.DataFrame:
    """Return the iterates of a group's rows, with fingerprint, label and `seconds` they took.

    An iterate is charged conversion, set-up, carrying back, and its share of the solve that was timed.

    >>> rows = pd.DataFrame({"key": ["k"], "fingerprint": ["f"], "label": ["s"], "convert": [1.0], "setup": [0.0],
    ...                      "lift": [0.0], "solve": [2.0]})
    >>> path = pd.DataFrame({"key": ["k", "k", "other"], "time": [1.0, 4.0, 1.0], "share": [0.25, 1.0, 1.0],
    ...                      "error": [1e-2, 1e-6, 0.0]})
    >>> charged(rows, path)["seconds"].tolist()
    [1.5, 3.0]
    """
    place, seconds, kept = _charged(rows, histories)
    own = rows[["fingerprint", "label", "solve", *BEFORE]].iloc[place].reset_index(drop=True)
    found = pd.concat([histories[kept].reset_index(drop=True), own], axis=1).assign(seconds=seconds)
    return found.sort_values(["label", "fingerprint", "time"], kind="stable", ignore_index=True)


def work_precision(rows: pd.DataFrame, histories: pd.DataFrame) -> pd.DataFrame:
    """Return how long each label took to each error down to the tolerance, over a group: label, error, reached,
    seconds.

    `reached` counts the problems on which an iterate was that good; `seconds` is the median time over all problems of
    the group, those that were not reached counting as ∞. Errors that a label reached nowhere have no row.
    """
    paths = _Paths(rows, histories)
    levels = sorted(e for e in ERRORS if e >= 0.99 * rows["tolerance"].min())
    tightest = np.searchsorted(levels, paths.error).astype(np.uint8)
    order = np.argsort(tightest, kind="stable")
    ends = np.searchsorted(tightest[order], np.arange(len(levels)), side="right")
    times = paths.never()
    parts: list[pd.DataFrame] = []
    for level, begin, end in zip(levels, [0, *ends[:-1]], ends, strict=True):
        # what was as good as a tighter level is as good as this one
        np.minimum.at(times.reshape(-1), paths.pair[order[begin:end]], paths.seconds[order[begin:end]])
        reached = np.isfinite(times).sum(axis=0)
        median = np.median(times, axis=0) if len(times) else np.full(len(reached), math.nan)
        parts.append(pd.DataFrame({"label": paths.labels, "error": level, "reached": reached, "seconds": median}))
    whole = pd.concat(parts, ignore_index=True)
    return whole[whole["reached"] > 0].sort_values(["label", "error"], ascending=[True, False], ignore_index=True)


def _charged(rows: pd.DataFrame, histories: pd.DataFrame) -> tuple[Array, Array, Array]:
    """Return for the iterates of these rows the row's place, the seconds charged, and which of all iterates they
    are.

    Keys are looked up once each: a history names its row as often as it has iterates.
    """
    codes, keys = pd.factorize(histories["key"])
    place = pd.Index(rows["key"]).get_indexer(pd.Index(keys))[codes]
    kept = place >= 0
    place = place[kept]
    solve = rows["solve"].to_numpy(dtype=float)[place]
    share, time = (histories.loc[kept, name].to_numpy(dtype=float) for name in ("share", "time"))
    rest = np.nansum(rows[list(BEFORE)].to_numpy(dtype=float), axis=1)[place]
    return place, np.where(np.isnan(solve), time, share * solve) + rest, kept


class _Paths:
    """The iterates of a group's rows: the place of their pair in the matrix of problems × labels with a history,
    seconds and error."""

    def __init__(self, rows: pd.DataFrame, histories: pd.DataFrame) -> None:
        place, self.seconds, kept = _charged(rows, histories)
        self.error = histories.loc[kept, "error"].fillna(math.inf).to_numpy(dtype=float)
        code, names = rows_of.codes(rows["label"])
        recorded = np.bincount(code[place], minlength=len(names)) > 0
        problem, problems = rows_of.codes(rows["fingerprint"])
        self.labels, self.problems = names[recorded].rename("label"), problems.rename("fingerprint")
        self.pair = (problem * len(self.labels) + (np.cumsum(recorded) - 1)[code])[place]

    def never(self) -> Matrix:
        """Return a matrix of ∞: nothing was ever reached."""
        return np.full((len(self.problems), len(self.labels)), math.inf)
