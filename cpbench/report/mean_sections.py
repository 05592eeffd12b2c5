"""The sections of a report about a group's times: means with what they hang on, and the gap to the virtual best."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from cpbench.analysis import best, bootstrap, means, sensitivity
from cpbench.analysis.profiles import FLOOR
from cpbench.report.run import each
from cpbench.report.text import code, counted, number, seconds, table


def mean_section(
    times: pd.DataFrame,
    lost: pd.DataFrame,
    families: pd.Series[str],
    limit: float,
    labels: Sequence[str],
    leading: Sequence[str],
) -> Iterator[str]:
    """Yield means over all and over commonly solved problems, their intervals, and their order under other choices.

    `labels` : the ranked ones, in the order of the tables. `leading` : those whose intersection is taken.
    `lost` : pairs that are left out (`table.lost`).
    """
    if not np.isfinite(times.to_numpy(dtype=float)).any():
        return
    every = means.means(times, limit=limit, lost=lost)
    common = means.means(times, shift=every.shift, limit=limit, common=leading)
    around = bootstrap.intervals(bootstrap.mean_time(times, every.shift, every.charge, lost), families)
    tried = _tried(times, limit)
    ranks = tried.groupby(["label", "shift"])["rank"].agg(_rank).unstack() if len(tried) else pd.DataFrame()
    shown = every.table.join(around.table[["low", "high"]]).join(common.table["mean"].rename("common"))
    shown = shown.reindex(pd.Index(labels, name="label")).reset_index()
    idle = shown["solved"] == 0
    yield "### Means"
    few = around.families < bootstrap.FEW  # an interval says nothing there
    head = [
        "solver",
        "solved",
        "charged",
        "lost",
        f"mean over all {every.problems}",
        *([] if few else ["95 % interval"]),
    ]
    head += [f"mean over {common.problems} in common"]
    yield table(
        [*head, *(f"rank at {seconds(shift)}" for shift in ranks.columns)],
        (
            [
                code(r.label),
                str(r.solved),
                str(r.charged),
                str(r.lost),
                seconds(r.mean),
                *([] if few else ["—" if math.isnan(r.low) else f"{seconds(r.low)} to {seconds(r.high)}"]),
                seconds(r.common),
                *(str(ranks[shift].get(r.label, "—")) for shift in ranks.columns),
            ]
            for r in each(shown[~idle])
        ),
        right=range(1, len(head) + len(ranks.columns)),
    )
    price = f"is charged {seconds(every.charge)}" if math.isfinite(every.charge) else "leaves none (no limit was set)"
    lines = [
        f"- mean: shifted geometric, shift {seconds(every.shift)} (median of all times); a problem not solved {price}",
        f"- {common.problems} in common: the problems that the {counted(len(leading), 'solver')} with the highest "
        "profiles all solve",
    ]
    lines[0] += f" ({every.remark})" if every.remark else ""
    if not few:
        lines.append(f"- interval: bootstrap of {counted(around.families, 'family', 'families')}")
    if common.remark:
        lines[1] += f": **{'few' if common.problems else 'none'}**"
    lines += [f"- not listed: {counted(int(idle.sum()), 'solver')} without an answer"] if idle.any() else []
    yield "\n".join([*lines, *_order(tried, every.shift)])


def gap_section(
    times: pd.DataFrame, lost: pd.DataFrame, labels: Sequence[str], leading: Sequence[str]
) -> Iterator[str]:
    """Yield each label against the virtual best of all."""
    gaps = best.gaps(times, compared=leading, lost=lost)
    if len(gaps) < 2 or not gaps["solved"].any():
        return
    common = int(gaps["common"].iloc[0])
    reached = int(np.isfinite(best.virtual_best(times)).sum())
    yield "### Gap to the virtual best"
    head = [
        "solver",
        "solved",
        f"within {best.WITHIN:g} times",
        "gap",
        f"gap over {common} in common",
        "only it solves",
    ]
    yield table(
        [*head, "best without it"],
        (
            [
                code(r.label),
                str(r.solved),
                f"{r.within:.0%}",
                number(r.mean),
                number(r.mean_common),
                str(r.alone),
                number(r.marginal),
            ]
            for r in each(gaps.reindex(pd.Index(labels, name="label")).query("solved > 0").reset_index())
        ),
        right=range(1, len(head) + 1),
    )
    yield (
        f"The fastest solver of each problem, taken together, solves {reached} of {len(times)}. Gap: geometric mean of "
        "the ratio to it over the problems that a solver solved. Best without it: how many times slower that would be."
    )


def below_floor(times: pd.DataFrame) -> dict[str, str]:
    """Count the times of each label that are too short to be distinguished."""
    floored = best.floored(times, FLOOR)
    return {str(label): str(count) for label, count in floored["below"].items()}


def _tried(times: pd.DataFrame, limit: float) -> pd.DataFrame:
    """Return means under other shifts and penalties of the labels that solve something; empty where there is no
    order.
    """
    tried = sensitivity.sensitivity(times[[label for label in times.columns if np.isfinite(times[label]).any()]], limit)
    return tried if tried["label"].nunique() > 1 and tried["charge"].notna().all() else tried.iloc[:0]


def _rank(ranks: pd.Series[int]) -> str:
    """Format the ranks under the three penalties, once where they are the same."""
    return "/".join(str(rank) for rank in (ranks if ranks.nunique() > 1 else ranks[:1]))


def _order(tried: pd.DataFrame, shift: float) -> list[str]:
    """Return the lines about the ranks, none where there is no rank."""
    if not len(tried):
        return []
    changed = len(sensitivity.order_changes(tried, shift))
    count = tried["label"].nunique()
    return [
        "- rank: by the mean with that shift; where the penalty decides, with the limit / 2 / 10 times the limit",
        f"- shift and penalty decide the order of {changed} of {counted(count * (count - 1) // 2, 'pair')} of solvers",
    ]
