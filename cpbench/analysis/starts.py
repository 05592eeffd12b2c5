"""Warm starts against cold ones: the same solver on the same problem at the same tolerance, from two starts.

A pair is a warm row and the cold row beside it. The geometric means of warm over cold are over the pairs that both
solved, and where the warm solve did start warm: what a warm start does when it works. How many each of the two solved
stands beside them.

Starts of a problem's file (`file`, `file:2`, ...) are cases of one formulation, not several formulations: `merged`
makes them so.
"""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.metrics import METRICS, spent
from cpbench.verification import VERIFIED, Status

COLD = "cold"
EVERY = "file:all"
"""Name of the start of merged rows."""
BEGAN = "began"
"""Column of merged rows with the start that was asked for."""
_SETTING = ["node", "fingerprint", "label", "tolerance", "threads", "set", "measure"]
_CASE = ["node", "label", "start"]
_NEEDED = (
    *_SETTING,
    "start",
    "problem",
    "sequence",
    "step",
    "family",
    "seconds",
    "started",
    "status",
    "counters",
    *rows_of.CHARGED,
)
COLUMNS = ("node", "label", "start", "pairs", "warm", "cold", "fell_back", "time", "iterations")


def pairs(table: pd.DataFrame) -> pd.DataFrame:
    """Pair every warm row with the cold row beside it: columns of the warm row, its `time` [s] and `iterations`,
    whether it `fell_back` to a cold start; and the cold row's `status_cold`, `time_cold` and `iterations_cold`.
    """
    is_cold = (table["start"] == COLD).to_numpy()
    is_warm = ~is_cold & (table["start"] != "").to_numpy()
    is_cold = is_cold & table["label"].isin(table["label"][is_warm].unique()).to_numpy()
    warm, cold = (_measured(table.loc[chosen, list(_NEEDED)]) for chosen in (is_warm, is_cold))
    cold = cold[[*_SETTING, "status", "time", "iterations"]]
    both = warm.merge(cold, on=_SETTING, suffixes=("", "_cold"))
    return both.assign(fell_back=both["started"].str.startswith(COLD))


def paired(table: pd.DataFrame) -> pd.DataFrame:
    """Return one row a formulation, label and warm start that has cold rows beside it.

    pairs, solved warm and cold, warm rows that fell back to a cold start (`fell_back`), and the geometric means of
    warm over cold over the pairs that both solved: `time` [s/s] and `iterations` (both NaN where there is no such pair,
    iterations also where the solver counts none).
    """
    pair_rows = pairs(table)
    warm, cold = rows_of.solved(pair_rows).to_numpy(), pair_rows["status_cold"].isin(VERIFIED).to_numpy()
    fell_back = pair_rows["fell_back"].to_numpy()
    common = warm & cold & ~fell_back
    rows: list[dict[str, object]] = []
    for case, at in pair_rows.groupby(_CASE, sort=True).indices.items():
        both = pair_rows[["time", "time_cold", "iterations", "iterations_cold"]].iloc[at[common[at]]]
        rows.append(
            {
                **_named(case),
                "pairs": len(at),
                "warm": int(warm[at].sum()),
                "cold": int(cold[at].sum()),
                "fell_back": int(fell_back[at].sum()),
                "time": _mean_ratio(both["time"], both["time_cold"]),
                "iterations": _mean_ratio(both["iterations"], both["iterations_cold"]),
            }
        )
    return pd.DataFrame(rows, columns=list(COLUMNS))


def honoured(table: pd.DataFrame) -> list[str]:
    """Return one line a start policy of which some rows started otherwise than requested: how many, and why.

    A reason with numbers in it stands for all that differ in the numbers alone.

    >>> rows = pd.DataFrame({"start": ["previous"] * 3, "started": ["cold: first step", "previous", "previous"],
    ...                      "status": "solved", "message": ""})
    >>> honoured(rows)
    ['start previous: 2 of 3 rows started so; 1 cold: first step']
    """
    lines: list[str] = []
    requested = table[~table["start"].isin(["", COLD]) & (table["status"] != str(Status.NOT_RUN))]
    for policy, rows in requested.groupby("start", sort=True):
        started, message = rows["started"].fillna("").astype(str), rows["message"].fillna("").astype(str)
        without = (rows["status"] == str(Status.UNSUPPORTED)) & message.str.contains(_NO_START)
        cold = started.str.startswith(COLD)
        of_start = rows[BEGAN] if BEGAN in rows else rows["start"]  # several starts of a file have one policy
        texts = zip(started[~cold], of_start[~cold], strict=True)
        other = [text.removeprefix(begun).lstrip(",: ") for text, begun in texts if text not in ("", begun)]
        reasons = [*started[cold], *("unsupported: " + message[without]), *(f"warm, {text}" for text in other)]
        if reasons:
            warm = int((~cold & (started != "")).sum())
            lines.append(f"start {policy}: {warm} of {len(rows)} rows started so; {_counted_alike(reasons)}")
    return lines


def several(table: pd.DataFrame) -> pd.Series[bool]:
    """Return whether each row is of a formulation of which some problem was started from several points of its file."""
    guess = table["start"].str.fullmatch(r"file(:\d+)?")
    if not guess.any():
        return guess
    counts = table[guess].groupby(["node", "fingerprint"])["start"].nunique()
    nodes = counts[counts > 1].index.get_level_values("node").unique()
    return guess & table["node"].isin(nodes)


def merged(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table with a problem for each start of a file, all of one start, `file:all`; itself where there is
    one start.

    >>> rows = pd.DataFrame({"problem": "p", "fingerprint": "f", "node": "ncp", "start": ["file", "file:2"]})
    >>> merged(rows)[["problem", "fingerprint", "start", "began"]].to_numpy().tolist()
    [['p from file', 'f/file', 'file:all', 'file'], ['p from file:2', 'f/file:2', 'file:all', 'file:2']]
    """
    chosen = several(table)
    if not chosen.any():
        return table
    start = table["start"].astype(object)
    return table.assign(
        problem=table["problem"].astype(object).where(~chosen, table["problem"] + " from " + start),
        fingerprint=table["fingerprint"].astype(object).where(~chosen, table["fingerprint"] + "/" + start),
        start=start.where(~chosen, EVERY),
        **{BEGAN: start},
    )


def original(fingerprint: str) -> str:
    """Return the fingerprint of the problem itself of a merged row.

    >>> original("5e/file:2"), original("5e")
    ('5e', '5e')
    """
    return re.sub(r"/file(:\d+)?$", "", fingerprint)


_NO_START = "^start|no starting point"
"""How the message of a row begins, or what it has, that had nothing to start from."""
_REASONS = 4
"""Reasons that a line names, the most frequent ones."""


def _counted_alike(reasons: list[str]) -> str:
    """Format as `190 cold: 21 contacts before, 22 now (and alike); 10 cold: first step`."""
    alike: dict[str, list[str]] = {}
    for reason in reasons:
        alike.setdefault(re.sub(r"\d+", "#", reason), []).append(reason)
    most = sorted(alike.values(), key=len, reverse=True)
    parts = [f"{len(same)} {same[0]}{' (and alike)' if len(set(same)) > 1 else ''}" for same in most[:_REASONS]]
    rest = sum(map(len, most[_REASONS:]))
    return "; ".join([*parts, *([f"{rest} for other reasons"] if rest else [])])


def _named(case: Any) -> dict[str, object]:
    return dict(zip(_CASE, case, strict=True))


def _measured(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with `time` and `iterations` in place of what these are made of."""
    counts = spent(rows, METRICS["iterations"])
    return rows_of.with_time(rows).assign(iterations=counts).drop(columns=["counters", *rows_of.CHARGED])


def _mean_ratio(warm: pd.Series[float], cold: pd.Series[float]) -> float:
    """Return the geometric mean of warm/cold; counts of 0 (a start that was good enough) are taken as 1."""
    usable = np.isfinite(warm) & np.isfinite(cold)
    if not usable.any():
        return math.nan
    floor = 1.0 if (warm[usable] % 1 == 0).all() else 0.0
    return float(np.exp(np.mean(np.log(np.maximum(warm[usable], floor) / np.maximum(cold[usable], floor)))))
