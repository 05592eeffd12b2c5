"""Sensitivity of an order by means to the choice of shift and penalty."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from cpbench.analysis.means import LIMIT, PAR2, PAR10, default_shift, means

CUSTOM = 10.0
"""The shift [s] of Mittelmann's tables and of qpbenchmark, for comparison."""


def sensitivity(times: pd.DataFrame, limit: float, shifts: Sequence[float] | None = None) -> pd.DataFrame:
    """Return the geometric means and ranks under other shifts and penalties, one row a setting and label.

    Shifts are 0.1, 1 and 10 times the median of the data and 10 s, unless given; penalties are the limit, PAR2, PAR10.
    Columns: shift [s], penalty, charge [s], label, mean [s], rank (1 is the least mean, ties share the lower number;
    labels without a mean share the last).

    >>> times = pd.DataFrame({"quick": [0.01, 0.01, float("inf")], "slow": [1.0, 1.0, 1.0]})
    >>> found = sensitivity(times, limit=10.0)
    >>> found[found["label"] == "quick"].groupby("shift")["rank"].max().to_dict()
    {0.1: 1, 1.0: 2, 10.0: 2}
    """
    median = default_shift(times)
    chosen = (median / 10, median, median * 10, CUSTOM) if shifts is None else shifts
    parts: list[pd.DataFrame] = []
    for shift in dict.fromkeys(chosen):
        for penalty in (LIMIT, PAR2, PAR10):
            found = means(times, shift=shift, penalty=penalty, limit=limit)
            mean = found.table["mean"]
            rank = mean.rank(method="min", na_option="bottom").astype(int)
            setting = {"shift": shift, "penalty": str(penalty), "charge": found.charge}
            parts.append(pd.DataFrame({**setting, "label": mean.index, "mean": mean.array, "rank": rank.array}))
    columns = ["shift", "penalty", "charge", "label", "mean", "rank"]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=columns)


def order_changes(table: pd.DataFrame, shift: float, penalty: str = "limit") -> pd.DataFrame:
    """Find pairs of labels that change places somewhere in a table of `sensitivity`: there the setting decides.

    Columns: first, second (their order under `shift` and `penalty`), settings (how many say otherwise), of (how many
    there are).
    """
    wide = table.pivot(index=["shift", "penalty"], columns="label", values="rank")
    columns = ["first", "second", "settings", "of"]
    if not len(wide):
        return pd.DataFrame(columns=columns)
    base = wide.loc[(shift, penalty)].sort_values(kind="stable")
    ranks = wide[base.index].to_numpy()
    found: list[tuple[str, str, int, int]] = []
    for i, first in enumerate(base.index):
        turned = (ranks[:, i + 1 :] < ranks[:, [i]]) & (base.iloc[i] < base.iloc[i + 1 :].to_numpy())
        found += [
            (str(first), str(base.index[i + 1 + j]), int(n), len(wide)) for j, n in enumerate(turned.sum(axis=0)) if n
        ]
    return pd.DataFrame(found, columns=columns)
