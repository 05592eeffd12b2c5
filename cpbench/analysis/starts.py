"""Warm starts against cold ones: the same solver on the same problem at the same tolerance, from two starts.

A pair is a warm row and the cold row beside it. Over the pairs of a label two geometric means of warm over cold tell
what the warm start gains, and they answer different questions:

- *common*: over the pairs that both solved, and where the warm solve did start warm. What a warm start does when it
  works; blind for those it makes fail.
- *all*: over every pair, a failure charged a penalty, a start that fell back to a cold one included. The gain of
  asking for warm starts.

Both come with a bootstrap interval that resamples sequences (families where there is no sequence): the steps of one
simulation resemble each other (`bootstrap`). Times below the floor count as equal.

Starts of a problem's file (`file`, `file:2`, ...) are cases of one formulation, not several formulations: `merged`
makes them so.
"""

from __future__ import annotations

import math
import re
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis import bootstrap
from cpbench.analysis import table as rows_of
from cpbench.analysis.means import LIMIT, Array, Penalty
from cpbench.analysis.metrics import METRICS, spent
from cpbench.analysis.profiles import FLOOR
from cpbench.analysis.table import Integers
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
GAINS = (
    "node", "label", "start", "pairs", "both", "only_warm", "only_cold", "neither", "fell_back", "slower", "common",
    "common_low", "common_high", "common_over", "all", "all_low", "all_high", "clusters",
)  # fmt: skip


def pairs(table: pd.DataFrame) -> pd.DataFrame:
    """Pair every warm row with the cold row beside it: columns of the warm row, its `time` [s] and `iterations`,
    whether it `fell_back` to a cold start; and the cold row's `status_cold`, `time_cold` and `iterations_cold`.
    """
    is_cold = (table["start"] == COLD).to_numpy()
    is_warm = ~is_cold & (table["start"] != "").to_numpy()
    is_cold = is_cold & table["label"].isin(table["label"][is_warm].unique()).to_numpy()
    warm, cold = (_measured(table.loc[chosen, list(_NEEDED)]) for chosen in (is_warm, is_cold))
    of_warm, of_cold = _settings(warm, cold)
    cold = cold[["status", "time", "iterations"]].assign(setting=of_cold)
    both = warm.assign(setting=of_warm).merge(cold, on="setting", suffixes=("", "_cold")).drop(columns="setting")
    return both.assign(fell_back=both["started"].str.startswith(COLD))


def paired(table: pd.DataFrame) -> pd.DataFrame:
    """Return one row a formulation, label and warm start that has cold rows beside it.

    pairs, solved warm and cold, warm rows that fell back to a cold start (`fell_back`), and the geometric means of
    warm over cold over the pairs that both solved: `time` [s/s] and `iterations` (both NaN where there is no such pair,
    iterations also where the solver counts none).
    """
    found = pairs(table)
    warm, cold = rows_of.solved(found).to_numpy(), found["status_cold"].isin(VERIFIED).to_numpy()
    fell_back = found["fell_back"].to_numpy()
    common = warm & cold & ~fell_back
    rows: list[dict[str, object]] = []
    for case, at in found.groupby(_CASE, sort=True).indices.items():
        both = found[["time", "time_cold", "iterations", "iterations_cold"]].iloc[at[common[at]]]
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


def gains(
    found: pd.DataFrame,
    penalty: Penalty = LIMIT,
    *,
    floor: float = FLOOR,
    level: float = 0.95,
    replicates: int = 1000,
    seed: int = 0,
) -> pd.DataFrame:
    """Compute what each warm start gains in time, one row a formulation, label and warm start of `pairs`.

    Columns: pairs; how many both solved, only the warm one, only the cold one, neither; fell_back; slower (both solved
    and the warm one took longer); the geometric means of warm over cold (below 1: the warm start is ahead) with their
    intervals: `common` over `common_over` pairs that both solved and that started warm, `all` over all pairs, each
    failure charged the penalty or the other's time, whichever is more (NaN where no limit is known); clusters (number
    of sequences or families resampled: with fewer than 5 an interval is a rough guess, with one there is none).

    >>> rows = pd.DataFrame({"problem": ["a", "b"] * 2, "label": "s", "start": ["cold", "cold", "previous", "previous"],
    ...                      "status": ["solved"] * 3 + ["timeout"], "solve": [4.0, 5.0, 1.0, 9.0], "seconds": 10.0})
    >>> found = gains(pairs(rows_of.normalised(rows))).iloc[0]
    >>> [round(found[name].item(), 3) for name in ("common", "all", "only_cold", "common_over")]
    [0.25, 0.707, 1, 1]
    """
    warm, cold = _floored(found["time"], floor), _floored(found["time_cold"], floor)
    done_warm, done_cold = np.isfinite(warm), np.isfinite(cold)
    both = done_warm & done_cold
    common = both & ~found["fell_back"].to_numpy()
    limit, limits = pd.factorize(found["seconds"])
    cost = np.array([*map(penalty.seconds_at, limits), penalty.seconds_at(math.inf)])[limit]
    charged_warm = np.where(done_warm, warm, np.maximum(cost, np.where(done_cold, cold, 0.0)))
    charged_cold = np.where(done_cold, cold, np.maximum(cost, np.where(done_warm, warm, 0.0)))
    with np.errstate(invalid="ignore"):
        every = np.log(charged_warm) - np.log(charged_cold)
        ratio = np.where(common, np.log(warm) - np.log(cold), 0.0)
    counts = {
        "pairs": np.ones(len(found), dtype=bool),
        "both": both,
        "only_warm": done_warm & ~done_cold,
        "only_cold": ~done_warm & done_cold,
        "neither": ~done_warm & ~done_cold,
        "fell_back": found["fell_back"].to_numpy(),
        "slower": both & (warm > cold),
        "common_over": common,
    }
    cluster = found["sequence"].where(found["sequence"] != "", found["family"]).to_numpy(dtype=object)
    rows: list[dict[str, object]] = []
    for case, at in found.groupby(_CASE, sort=True).indices.items():
        record = _named(case) | {name: int(where[at].sum()) for name, where in counts.items()}
        families = pd.Series(cluster[at])
        top = np.column_stack([ratio[at], every[at]])
        bottom = np.column_stack([common[at].astype(float), np.ones(len(at))])
        statistic = bootstrap.Statistic(("common", "all"), families.index, top, bottom, np.exp)
        around = bootstrap.intervals(statistic, families, level=level, replicates=replicates, seed=seed)
        for name in ("common", "all"):
            record[name] = float(around.table.loc[name, "estimate"])
            record |= {f"{name}_{end}": float(around.table.loc[name, end]) for end in ("low", "high")}
        rows.append(record | {"clusters": around.families})
    return pd.DataFrame(rows, columns=list(GAINS))


def losses(found: pd.DataFrame, beyond: float = 1.0, floor: float = FLOOR) -> pd.DataFrame:
    """Return those of `pairs` in which the warm start loses: the cold one alone solved, or the warm one took longer.

    One row a pair, per formulation, label and start the worst first (failures, then by ratio): node, label, start,
    problem, fingerprint, sequence, step, status, time, time_cold [s], ratio (∞ for a failure).

    Parameters
    ----------
    beyond : ratio of times above which a pair is listed; noise alone makes half of equal pairs slower than 1.
    """
    warm, cold = _floored(found["time"], floor), _floored(found["time_cold"], floor)
    with np.errstate(invalid="ignore"):
        ratio = np.where(np.isfinite(cold), warm / cold, 0.0)
    columns = [*_CASE, "problem", "fingerprint", "sequence", "step", "status", "time", "time_cold"]
    lost = found[columns].assign(ratio=ratio)[ratio > beyond]
    return lost.sort_values(
        [*_CASE, "ratio", "sequence", "step", "problem"],
        ascending=[True, True, True, False, True, True, True],
        ignore_index=True,
    )


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
        own = rows[BEGAN] if BEGAN in rows else rows["start"]  # several starts of a file have one policy
        texts = zip(started[~cold], own[~cold], strict=True)
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
    found: dict[str, list[str]] = {}
    for reason in reasons:
        found.setdefault(re.sub(r"\d+", "#", reason), []).append(reason)
    most = sorted(found.values(), key=len, reverse=True)
    parts = [f"{len(same)} {same[0]}{' (and alike)' if len(set(same)) > 1 else ''}" for same in most[:_REASONS]]
    rest = sum(map(len, most[_REASONS:]))
    return "; ".join([*parts, *([f"{rest} for other reasons"] if rest else [])])


def _settings(warm: pd.DataFrame, cold: pd.DataFrame) -> tuple[Integers, Integers]:
    """Give each row a number by what a pair has in common: merging on it is faster than on seven columns of text."""
    setting = np.zeros(len(warm) + len(cold), dtype=np.int64)
    for name in _SETTING:
        code, values = pd.factorize(pd.concat([warm[name], cold[name]]), use_na_sentinel=False)
        setting = pd.factorize(setting * len(values) + code)[0]
    return setting[: len(warm)], setting[len(warm) :]


def _named(case: Any) -> dict[str, object]:
    return dict(zip(_CASE, case, strict=True))


def _measured(rows: pd.DataFrame) -> pd.DataFrame:
    """Return the rows with `time` and `iterations` in place of what these are made of."""
    counts = spent(rows, METRICS["iterations"])
    return rows_of.with_time(rows).assign(iterations=counts).drop(columns=["counters", *rows_of.CHARGED])


def _floored(seconds: pd.Series[float], floor: float) -> Array:
    return np.maximum(seconds.fillna(math.inf).to_numpy(dtype=float), floor)


def _mean_ratio(warm: pd.Series[float], cold: pd.Series[float]) -> float:
    """Return the geometric mean of warm/cold; counts of 0 (a start that was good enough) are taken as 1."""
    usable = np.isfinite(warm) & np.isfinite(cold)
    if not usable.any():
        return math.nan
    floor = 1.0 if (warm[usable] % 1 == 0).all() else 0.0
    return float(np.exp(np.mean(np.log(np.maximum(warm[usable], floor) / np.maximum(cold[usable], floor)))))
