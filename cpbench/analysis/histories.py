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
    positions, seconds, kept = _charged(rows, histories)
    own = rows[["fingerprint", "label", "solve", *BEFORE]].iloc[positions].reset_index(drop=True)
    iterates = pd.concat([histories[kept].reset_index(drop=True), own], axis=1).assign(seconds=seconds)
    return iterates.sort_values(["label", "fingerprint", "time"], kind="stable", ignore_index=True)


def work_precision(rows: pd.DataFrame, histories: pd.DataFrame) -> pd.DataFrame:
    """Return how long each label took to each error down to the tolerance, over a group: label, error, reached,
    seconds.

    `reached` counts the problems on which an iterate was that good; `seconds` is the median time over all problems of
    the group, those that were not reached counting as ∞. Errors that a label reached nowhere have no row.
    """
    positions, seconds, kept = _charged(rows, histories)
    error = histories.loc[kept, "error"].fillna(math.inf).to_numpy(dtype=float)
    levels = np.array(sorted(e for e in ERRORS if e >= 0.99 * rows["tolerance"].min()))
    level = np.searchsorted(levels, error)
    labels, names = rows_of.codes(rows["label"])
    problems, every = rows_of.codes(rows["fingerprint"])
    label, problem = labels[positions], problems[positions]
    curves = [pd.DataFrame({"label": [], "error": [], "reached": [], "seconds": []})]
    for code, name in enumerate(names):  # one after the other: all of a million rows would be gigabytes
        own = (label == code) & (level < levels.size)
        times = np.full((len(every), levels.size), math.inf)
        np.minimum.at(times, (problem[own], level[own]), seconds[own])
        np.minimum.accumulate(times, axis=1, out=times)  # what was as good as a tighter level is as good as this one
        reached, median = (times < math.inf).sum(axis=0), np.median(times, axis=0)
        curve = pd.DataFrame({"label": name, "error": levels, "reached": reached, "seconds": median})
        curves.append(curve[curve["reached"] > 0].iloc[::-1])
    return pd.concat(curves[1:] or curves, ignore_index=True)


def _charged(rows: pd.DataFrame, histories: pd.DataFrame) -> tuple[Array, Array, Array]:
    """Return for the iterates of these rows the row's place, the seconds charged, and which of all iterates they
    are.

    Keys are looked up once each: a history names its row as often as it has iterates.
    """
    codes, keys = pd.factorize(histories["key"])
    positions = pd.Index(rows["key"]).get_indexer(pd.Index(keys))[codes]
    kept = positions >= 0
    positions = positions[kept]
    solve = rows["solve"].to_numpy(dtype=float)[positions]
    share, time = (histories.loc[kept, name].to_numpy(dtype=float) for name in ("share", "time"))
    rest = np.nansum(rows[list(BEFORE)].to_numpy(dtype=float), axis=1)[positions]
    return positions, np.where(np.isnan(solve), time, share * solve) + rest, kept
