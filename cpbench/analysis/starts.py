"""Warm starts against cold ones: the same solver on the same problem at the same tolerance, from two starts."""

from __future__ import annotations

import json
import math

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.verification import VERIFIED

COLD = "cold"
_PAIR = ["node", "fingerprint", "label", "tolerance", "threads", "set", "measure"]
COLUMNS = ("node", "label", "start", "pairs", "warm", "cold", "fell_back", "time", "iterations")


def paired(table: pd.DataFrame) -> pd.DataFrame:
    """One row a formulation, label and warm start that has cold rows beside it.

    pairs, solved warm and cold, warm rows that fell back to a cold start (`fell_back`), and the geometric means of
    warm over cold over the pairs that both solved: `time` [s/s] and `iterations` (both NaN where there is no such pair,
    iterations also where the solver counts none).
    """
    timed = rows_of.with_time(table)
    timed = timed.assign(iterations=[_iterations(text) for text in timed["counters"]])
    cold, warm = timed[timed["start"] == COLD], timed[~timed["start"].isin(["", COLD])]
    both = warm.merge(cold, on=_PAIR, suffixes=("", "_cold"))
    rows: list[dict[str, object]] = []
    for (node, label, start), part in both.groupby(["node", "label", "start"], sort=True):  # type: ignore[misc]
        solved = part[rows_of.solved(part) & part["status_cold"].isin(VERIFIED)]
        solved = solved[~solved["started"].str.startswith(COLD)]
        rows.append(
            {
                "node": node,
                "label": label,
                "start": start,
                "pairs": len(part),
                "warm": int(rows_of.solved(part).sum()),
                "cold": int(part["status_cold"].isin(VERIFIED).sum()),
                "fell_back": int(part["started"].str.startswith(COLD).sum()),
                "time": _mean_ratio(solved["time"], solved["time_cold"]),
                "iterations": _mean_ratio(solved["iterations"], solved["iterations_cold"]),
            }
        )
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _iterations(counters: str) -> float:
    return float((json.loads(counters) if counters else {}).get("iterations", math.nan))


def _mean_ratio(warm: pd.Series[float], cold: pd.Series[float]) -> float:
    """Geometric mean of warm/cold; counts of 0 (a start that was good enough) are taken as 1."""
    usable = np.isfinite(warm) & np.isfinite(cold)
    if not usable.any():
        return math.nan
    floor = 1.0 if (warm[usable] % 1 == 0).all() else 0.0
    return float(np.exp(np.mean(np.log(np.maximum(warm[usable], floor) / np.maximum(cold[usable], floor)))))
