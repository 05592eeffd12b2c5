"""Summary of a group of results: quantiles of times, counts by status and by family, sizes."""

from __future__ import annotations

import json
import math

import numpy as np
import pandas as pd

from cpbench.analysis import table as rows_of


def quantile(times: pd.DataFrame, share: float) -> pd.Series[float]:
    """Return the least time within which this share of all problems was solved, by label; ∞ where fewer were, NaN of no
    problem. It is a time that was measured, never a blend of a time and a failure.

    >>> quantile(pd.DataFrame({"s": [4.0, 1.0, np.inf, 2.0]}), 0.75)["s"].item()
    4.0
    """
    ordered = np.sort(times.fillna(np.inf).to_numpy(dtype=float), axis=0)
    # 0.07 · 100 is 7.000000000000001 in doubles, and the 7th value it is that has 7 % within
    position = math.ceil(share * len(ordered) - 1e-9) - 1
    return pd.Series(ordered[position] if len(ordered) else math.nan, index=times.columns, dtype=float)


def verdicts(group: pd.DataFrame) -> pd.DataFrame:
    """Count rows by label (sorted) and status (those that occur, in the order of Status).

    >>> rows = pd.DataFrame({"label": ["b", "a", "b"], "status": ["wrong", "solved", "solved"]})
    >>> verdicts(rows).to_dict("index")
    {'a': {'solved': 1, 'wrong': 0}, 'b': {'solved': 1, 'wrong': 1}}
    """
    label, labels = rows_of.codes(group["label"])
    status, statuses = rows_of.codes(group["status"])
    counts = np.bincount(label * len(statuses) + status, minlength=len(labels) * len(statuses))
    wide = pd.DataFrame(
        counts.reshape(len(labels), len(statuses)), index=labels.rename("label"), columns=list(statuses)
    )
    return wide[[s for s in rows_of.STATUSES if s in wide]]


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
    summary = pd.DataFrame({"problems": parts["fingerprint"].nunique(), "pairs": parts.size()})
    numbers = {
        "some": reached.groupby("family")["fingerprint"].nunique(),
        "solved": reached.groupby("family").size(),
        "most": most,
    }
    for name, values in numbers.items():
        summary[name] = values.reindex(summary.index).fillna(0).astype(int)
    summary["best"] = [best_of.get(family, []) for family in summary.index]
    columns = ["family", "problems", "some", "pairs", "solved", "most", "best"]
    return summary.rename_axis("family").reset_index()[columns]


def beside(group: pd.DataFrame, part: str, tolerance: float) -> pd.DataFrame:
    """Compare the errors of a group with a part of the verdict, by label: answers that have both, the median of either,
    and how many pass the tolerance by both, by the error alone, and by the part alone.

    >>> rows = pd.DataFrame({"label": "s", "error": [1e-9, 1e-3], "parts": ['{"natural": 1e-9}', '{"natural": 1e-7}']})
    >>> beside(rows, "natural", 1e-6)[["answers", "both", "ours", "theirs"]].loc["s"].tolist()
    [2, 1, 0, 1]
    """
    theirs = group["parts"].map(lambda parts: json.loads(parts or "{}").get(part, math.nan)).astype(float)
    comparable = theirs.notna() & np.isfinite(group["error"])
    passes, they = group["error"] <= tolerance, theirs <= tolerance
    labels = group["label"][comparable].astype(object)
    medians = pd.DataFrame({"error": group["error"], "part": theirs})[comparable].groupby(labels).median()
    passed = pd.DataFrame({"both": passes & they, "ours": passes & ~they, "theirs": ~passes & they})
    medians.insert(0, "answers", labels.value_counts())
    return medians.join(passed[comparable].astype(int).groupby(labels).sum())


def size_ranges(group: pd.DataFrame) -> dict[str, tuple[int, int]]:
    """Return the least and largest value of each dimension of the problems of a group.

    >>> size_ranges(pd.DataFrame({"sizes": ['{"n": 3}', '{"n": 7, "m": 1}']}))
    {'m': (1, 1), 'n': (3, 7)}
    """
    by_symbol: dict[str, list[int]] = {}
    for sizes in rows_of.sizes_read(group)[1]:
        for symbol, size in sizes.items():
            by_symbol.setdefault(symbol, []).append(int(size))
    return {symbol: (min(values), max(values)) for symbol, values in sorted(by_symbol.items())}
