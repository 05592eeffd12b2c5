"""Summary of a group of results: how much each label solved and how fast, by status, node and family."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd

from cpbench.analysis import best, means
from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import REFUSED
from cpbench.analysis.profiles import FLOOR
from cpbench.analysis.reliability import false_claims
from cpbench.verification import Status


def solve_counts(group: pd.DataFrame, penalty: float, shift: float | None = None, floor: float = FLOOR) -> pd.DataFrame:
    """Count what each label solved and how fast, one row a label, best first.

    Labels whose answers were made elsewhere (`table.ranked`) are not ranked: fastest is 0, slowdown and mean are NaN.

    Columns: kind (weakest route), ranked, planned, ran (the solver was started), solved, lost (of what ran, by a
    conversion, which is charged), stationary (not among the solved), false (claimed and is not, on the solver's own
    problem), fastest (problems where it shares the lead), median [s] and slowdown (median ratio to the virtual best)
    over what it solved, p95 and p99 [s] (`quantile`), mean [s] (shifted geometric over all problems of the group but
    the lost ones, failures and problems that were not planned charged `penalty`).
    """
    every = rows_of.times(group)
    among = rows_of.ranked(group)
    times = every if among.all() else rows_of.times(group[among])
    labels = every.columns
    gap = best.gaps(times, floor).reindex(labels)
    lost = rows_of.lost(group)
    mean = means.means(times, shift=shift, penalty=means.Penalty(seconds=penalty), lost=lost).table["mean"]

    def count(of_rows: pd.Series[str]) -> pd.Series[int]:
        return of_rows.value_counts().reindex(labels, fill_value=0).astype(int)

    found = pd.DataFrame(
        {
            "label": labels,
            "kind": pd.Series(rows_of.label_kinds(group), dtype=object).reindex(labels),
            "ranked": labels.isin(times.columns),
            "planned": count(group["label"]),
            "ran": count(group["label"][~group["status"].isin(REFUSED)]),
            "solved": count(group["label"][rows_of.solved(group)]),
            "lost": lost.sum().reindex(labels, fill_value=0).astype(int),
            "stationary": count(group["label"][group["status"] == str(Status.STATIONARY)]),
            "false": count(false_claims(group)["label"]),
            "fastest": gap["fastest"].fillna(0).astype(int),
            "median": every.where(np.isfinite(every)).median(),
            "slowdown": gap["median"],
            "p95": quantile(every, 0.95),
            "p99": quantile(every, 0.99),
            "mean": mean.reindex(labels),
        }
    ).reset_index(drop=True)
    found["_less"] = -found["solved"]
    return found.sort_values(["_less", "mean", "label"], ignore_index=True).drop(columns="_less")


def quantile(times: pd.DataFrame, share: float) -> pd.Series[float]:
    """Return the least time within which this share of all problems was solved, by label; ∞ where fewer were, NaN of no
    problem. It is a time that was measured, never a blend of a time and a failure.

    >>> quantile(pd.DataFrame({"s": [4.0, 1.0, np.inf, 2.0]}), 0.75)["s"].item()
    4.0
    """
    ordered = np.sort(times.fillna(np.inf).to_numpy(dtype=float), axis=0)
    # 0.07 · 100 is 7.000000000000001 in doubles, and the 7th value it is that has 7 % within
    place = math.ceil(share * len(ordered) - 1e-9) - 1
    return pd.Series(ordered[place] if len(ordered) else math.nan, index=times.columns, dtype=float)


def verdicts(group: pd.DataFrame) -> pd.DataFrame:
    """Count rows by label (sorted) and status (those that occur, in the order of Status).

    >>> rows = pd.DataFrame({"label": ["b", "a", "b"], "status": ["wrong", "solved", "solved"]})
    >>> verdicts(rows).to_dict("index")
    {'a': {'solved': 1, 'wrong': 0}, 'b': {'solved': 1, 'wrong': 1}}
    """
    label, labels = rows_of.codes(group["label"])
    status, found = rows_of.codes(group["status"])
    counts = np.bincount(label * len(found) + status, minlength=len(labels) * len(found))
    wide = pd.DataFrame(counts.reshape(len(labels), len(found)), index=labels.rename("label"), columns=list(found))
    return wide[[s for s in rows_of.STATUSES if s in wide]]


def nodes(table: pd.DataFrame) -> pd.DataFrame:
    """Summarise groups, one row each: problems, labels, pairs, solved by some label, by none, and the labels that
    solve most.
    """
    records: list[dict[str, object]] = []
    for group, rows in rows_of.groups(table):
        reached = rows.loc[rows_of.solved(rows), ["label", "fingerprint"]]
        count = reached.groupby("label")["fingerprint"].nunique()
        most = int(count.max()) if len(count) else 0
        problems = rows["fingerprint"].nunique()
        some = reached["fingerprint"].nunique()
        records.append(
            {
                "group": group,
                "problems": problems,
                "labels": rows["label"].nunique(),
                "pairs": len(rows),
                "some": some,
                "none": problems - some,
                "most": most,
                "best": sorted(str(label) for label in count.index[count == most]) if most else [],
            }
        )
    columns = ["group", "problems", "labels", "pairs", "some", "none", "most", "best"]
    return pd.DataFrame(records, columns=columns)


def families(group: pd.DataFrame) -> pd.DataFrame:
    """Summarise families, one row each: problems, solved by some label, pairs, solved pairs, most solved by one
    label, which.

    Problems of one family resemble each other: a suite's total says what its largest family says.
    """
    reached = group.loc[rows_of.solved(group), ["family", "label", "fingerprint"]]
    count = reached.groupby(["family", "label"])["fingerprint"].nunique().reset_index(name="count")
    most = count.groupby("family")["count"].max()
    leading = count[count["count"] == count["family"].map(most)].sort_values(["family", "label"])
    best_of = leading.groupby("family")["label"].agg(list)
    parts = group.groupby("family", sort=True)
    found = pd.DataFrame({"problems": parts["fingerprint"].nunique(), "pairs": parts.size()})
    numbers = {
        "some": reached.groupby("family")["fingerprint"].nunique(),
        "solved": reached.groupby("family").size(),
        "most": most,
    }
    for name, values in numbers.items():
        found[name] = values.reindex(found.index).fillna(0).astype(int)
    found["best"] = [best_of.get(family, []) for family in found.index]
    columns = ["family", "problems", "some", "pairs", "solved", "most", "best"]
    return found.rename_axis("family").reset_index()[columns]


def size_ranges(group: pd.DataFrame) -> dict[str, tuple[int, int]]:
    """Return the least and largest value of each dimension of the problems of a group.

    >>> size_ranges(pd.DataFrame({"sizes": ['{"n": 3}', '{"n": 7, "m": 1}']}))
    {'m': (1, 1), 'n': (3, 7)}
    """
    found: dict[str, list[int]] = {}
    for sizes in rows_of.sizes_read(group)[1]:
        for symbol, size in sizes.items():
            found.setdefault(symbol, []).append(int(size))
    return {symbol: (min(values), max(values)) for symbol, values in sorted(found.items())}
