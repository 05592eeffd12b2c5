"""The sections of a report about a group's times: means with what they hang on, and the gap to the virtual best."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd

from cpbench.analysis import best, bootstrap, means
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
    """Yield means over all and over commonly solved problems, their intervals.

    `labels` : the ranked ones, in the order of the tables. `leading` : those whose intersection is taken.
    `lost` : pairs that are left out (`table.lost`).
    """
    if not np.isfinite(times.to_numpy(dtype=float)).any():
        return
    every = means.means(times, limit=limit, lost=lost)
    common = means.means(times, shift=every.shift, limit=limit, common=leading)
    around = bootstrap.intervals(bootstrap.mean_time(times, every.shift, every.charge, lost), families)
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
        head,
        (
            [
                code(r.label),
                str(r.solved),
                str(r.charged),
                str(r.lost),
                seconds(r.mean),
                *([] if few else ["—" if math.isnan(r.low) else f"{seconds(r.low)} to {seconds(r.high)}"]),
                seconds(r.common),
            ]
            for r in each(shown[~idle])
        ),
        right=range(1, len(head)),
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
    yield "\n".join(lines)


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
