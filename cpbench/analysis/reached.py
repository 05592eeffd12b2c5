"""Times at equal reached error: what it took to come within a tolerance, whatever was asked for.

A solver that is asked for ε may end far below ε, and pays for that. Results that have several tolerances, or the
histories of solves, show less: with errors e and times t of all that is known of problem p and solver s,

    t[p, s](ε) = min { t_k : e_k ≤ ε },      k: the answers at every tolerance, and the iterates of every history.

Each time is an upper bound. Where only one tolerance was run, and no history was kept, it is the time as it stands.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from cpbench.analysis import histories as paths
from cpbench.analysis import table as rows_of

PAIR = ["node", "fingerprint", "label", "start", "threads", "set", "measure"]
"""Columns that the rows of a pair at several tolerances share."""
SENTENCE = (
    "Times are those of the cheapest answer or iterate of each pair whose error is at most the tolerance, whatever was "
    "asked for (--reached)"
)
"""Remark on a table of such times."""


def at_reached(table: pd.DataFrame, histories: pd.DataFrame | None = None) -> pd.DataFrame:
    """Return the table with the times t[p, s](ε) of its solved rows: as `solve`, and with no other part.

    Parameters
    ----------
    table : normalised. histories : iterates of its rows, by `key` (`analysis.histories`).

    >>> rows = pd.DataFrame({"key": ["a", "b", "c"], "problem": "p", "label": ["s", "s", "t"], "status": "solved",
    ...     "tolerance": [1e-2, 1e-4, 1e-4], "error": [1e-5, 1e-9, 1e-5], "solve": [1.0, 3.0, 2.0]})
    >>> at_reached(rows_of.normalised(rows))[["key", "solve"]].values.tolist()
    [['a', 1.0], ['b', 1.0], ['c', 2.0]]
    """
    done = rows_of.solved(table)
    pair = table.groupby(PAIR, sort=False, dropna=False).ngroup().to_numpy()
    known = [_points(pair[done], table.loc[done, "error"], rows_of.charged(table[done]))]
    if histories is not None and len(histories):
        iterates = paths.charged(table, histories)
        place = pd.Series(pair, index=table["key"])
        own = place[iterates["key"]].to_numpy()
        known.append(_points(own, iterates["error"], iterates["seconds"].to_numpy(dtype=float)))
    least = _least(pd.concat(known, ignore_index=True), pair[done], table.loc[done, "tolerance"].to_numpy(dtype=float))
    result = table.copy()
    result.loc[done, "solve"] = np.minimum(least, rows_of.charged(table[done]))
    result.loc[done, ["convert", "setup", "lift"]] = 0.0
    return result


def _points(pair: np.ndarray, error: pd.Series, seconds: np.ndarray) -> pd.DataFrame:
    """Return pair, error and seconds of answers or iterates."""
    return pd.DataFrame({"pair": pair, "error": error.to_numpy(dtype=float), "seconds": seconds})


def _least(points: pd.DataFrame, pair: np.ndarray, tolerance: np.ndarray) -> rows_of.Floats:
    """Return the least seconds of the points of each pair whose error is at most the tolerance; ∞ without one."""
    least = np.full(len(pair), np.inf)
    for level in np.unique(tolerance):
        within = points[points["error"] <= level].groupby("pair")["seconds"].min()
        here = tolerance == level
        least[here] = within.reindex(pair[here], fill_value=np.inf).to_numpy()
    return least
