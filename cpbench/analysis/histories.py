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
    levels = sorted(e for e in ERRORS if e >= 0.99 * rows["tolerance"].min())
    iterates = (
        rows[["label", "fingerprint"]].iloc[positions].assign(level=np.searchsorted(levels, error), seconds=seconds)
    )
    first = iterates.groupby(["level", "label", "fingerprint"])["seconds"].min()
    pairs = pd.MultiIndex.from_product([sorted(iterates["label"].unique()), sorted(rows["fingerprint"].unique())])
    # what was as good as a tighter level is as good as this one
    times = first.unstack("level").reindex(index=pairs, columns=range(len(levels))).fillna(math.inf).cummin(axis=1)
    by_label = times.groupby(level=0, sort=True)
    points = pd.DataFrame(
        {"reached": (times < math.inf).groupby(level=0).sum().stack(), "seconds": by_label.median().stack()}
    )
    points = points.rename_axis(["label", "level"]).reset_index()
    points = points.assign(error=np.array(levels)[points["level"].to_numpy(dtype=int)])
    whole = points[points["reached"] > 0].sort_values(["label", "error"], ascending=[True, False], ignore_index=True)
    return whole[["label", "error", "reached", "seconds"]]


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
