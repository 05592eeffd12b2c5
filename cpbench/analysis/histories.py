"""Error against time: what the iterates of a group's solves tell about every tolerance at once.

`histories` is a table with one row a judged iterate: `key` of the row it belongs to, `time` [s] since its solve began,
`share` of the recorded solve that was over, `iteration`, `told` (the solver's residual) and `error` (ours). Iterates
are kept at growing intervals, so that every time here is an upper bound.
"""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

COLUMNS = ("key", "time", "iteration", "told", "error", "share")
ERRORS = tuple(float(f"{10.0 ** (-k / 4):.6e}") for k in range(57))
"""Quarter decades from 1 to 1e-14, whole ones exact."""
BEFORE = ("convert", "setup", "lift")
"""What a solver's time has besides its solve, of which the history tells a share."""


def charged(rows: pd.DataFrame, histories: pd.DataFrame) -> pd.DataFrame:
    """The iterates of a group's rows, with fingerprint, label and `seconds` they took.

    An iterate is charged conversion, set-up, carrying back, and its share of the solve that was timed.

    >>> rows = pd.DataFrame({"key": ["k"], "fingerprint": ["f"], "label": ["s"], "convert": [1.0], "setup": [0.0],
    ...                      "lift": [0.0], "solve": [2.0]})
    >>> path = pd.DataFrame({"key": ["k", "k", "other"], "time": [1.0, 4.0, 1.0], "share": [0.25, 1.0, 1.0],
    ...                      "error": [1e-2, 1e-6, 0.0]})
    >>> charged(rows, path)["seconds"].tolist()
    [1.5, 3.0]
    """
    own = rows[["key", "fingerprint", "label", "solve", *BEFORE]]
    found = histories.merge(own, on="key", how="inner").sort_values(["label", "fingerprint", "time"], kind="stable")
    solve = (found["share"] * found["solve"]).where(found["solve"].notna(), found["time"])
    return found.assign(seconds=solve + found[list(BEFORE)].fillna(0.0).sum(axis=1)).reset_index(drop=True)


def times_to(rows: pd.DataFrame, histories: pd.DataFrame, tolerance: float) -> pd.DataFrame:
    """Seconds to the first iterate that solves a problem at a tolerance, problems × labels; ∞ where none does.

    This is what a performance profile at that tolerance is made from. Labels without any history are left out.
    """
    return _first(charged(rows, histories), set(rows["fingerprint"]), tolerance)


def work_precision(rows: pd.DataFrame, histories: pd.DataFrame) -> pd.DataFrame:
    """How long each label took to each error down to the tolerance, over a group: label, error, reached, seconds.

    `reached` counts the problems on which an iterate was that good; `seconds` is the median time over all problems of
    the group, those that were not reached counting as ∞. Errors that a label reached nowhere have no row.
    """
    found, problems = charged(rows, histories), set(rows["fingerprint"])
    parts: list[pd.DataFrame] = []
    for error in (e for e in ERRORS if e >= 0.99 * rows["tolerance"].min()):
        times = _first(found, problems, error)
        reached = np.isfinite(times).sum()
        parts.append(
            pd.DataFrame({"label": times.columns, "error": error, "reached": reached, "seconds": times.median()})
        )
    whole = pd.concat(parts, ignore_index=True)
    return whole[whole["reached"] > 0].sort_values(["label", "error"], ascending=[True, False], ignore_index=True)


def _first(found: pd.DataFrame, problems: set[str], tolerance: float) -> pd.DataFrame:
    """Least seconds of an iterate within the tolerance, problems × labels."""
    good = found[found["error"] <= tolerance].groupby(["fingerprint", "label"])["seconds"].min().reset_index()
    wide = good.pivot(index="fingerprint", columns="label", values="seconds")
    return wide.reindex(index=sorted(problems), columns=sorted(set(found["label"]))).astype(float).fillna(math.inf)
