"""Numbers of a whole group for the page, whatever is filtered there: the order of its solvers, ranking with intervals,
bands around the curves of its profile, error against time, growth with size, warm starts.

A *sheet* is a figure of dots and its table: `head`, and `lines` of `label`, `v` with its interval `low` to `high`
(None without), `note` (text of the dot) and `cells` (text, under the head after its first).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis import bands as around
from cpbench.analysis import bootstrap, histories, means, metrics, scaling, starts, summary
from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import REFUSED
from cpbench.analysis.profiles import performance_profile
from cpbench.analysis.ranking import Ranking
from cpbench.report import convergence
from cpbench.report.answer import HEAD, cells_of
from cpbench.report.figures import INEXACT
from cpbench.report.run import each
from cpbench.report.text import number, one_line, seconds

Sheet = dict[str, Any]
BANDED = 12
"""Solvers with a band: those in colour, and a few that follow when one of these is hidden."""
DIGITS = 4
"""Of the fractions of bands: no screen shows more."""


def order(rows: pd.DataFrame) -> list[str]:
    """Return the labels of a group: by the area under the performance profile of their times those that solve something
    and are ranked, then the others, in order of label."""
    compared = rows_of.only_ranked(rows)
    leading: list[str] = []
    if len(compared):
        spent = metrics.measured(compared, metrics.METRICS["time"])
        profile = performance_profile(spent.values, rows["fingerprint"].nunique(), lost=spent.lost)
        leading = profile.leading(len(profile.curves))
    first = set(leading)
    return [*leading, *sorted(set(rows["label"]) - first)]


def ranking(rows: pd.DataFrame) -> Sheet:
    """Return the sheet of what each label solved, most solved first, with its interval over families, and its times."""
    times = rows_of.times(rows)
    counts = summary.solve_counts(rows, means.charge(times, means.LIMIT, rows_of.limit(rows)))
    started = rows_of.spread(rows, (~rows["status"].isin(REFUSED)).to_numpy(), False)
    rate = bootstrap.solve_rate(times, started, rows_of.lost(rows))
    around = bootstrap.intervals(rate, bootstrap.families_of(rows))
    few = around.families < bootstrap.FEW
    head = ["solver", "solved", "lost", "stationary", "ran", "95 % interval", "false claims", "fastest"]
    counted = counts.merge(around.table[["low", "high"]].reset_index(), on="label", how="left")
    return {
        "head": [*head, "median of solved", "p95", "p99", "slowdown", "mean"],
        "lines": [_solved_line(r, few) for r in each(counted)],
        "few": few,
    }


def _solved_line(r: Any, few: bool) -> dict[str, Any]:
    """Return the line of a label; where families are few, an interval says nothing."""
    counted = r.ran - r.lost
    low, high = (math.nan, math.nan) if few else (float(r.low), float(r.high))
    cells = [
        str(r.solved),
        str(r.lost),
        str(r.stationary),
        str(r.ran),
        "—" if math.isnan(low) else f"{_percent(low)} to {_percent(high)}",
        "see routes" if r.kind in INEXACT else str(r.false),
        str(r.fastest) if r.ranked else "—",
        seconds(r.median),
        seconds(r.p95),
        seconds(r.p99),
        number(r.slowdown),
        seconds(r.mean),
    ]
    share = r.solved / counted if counted else 0.0
    return _line(r.label, share, low, high, f"{r.solved} of {counted}", cells) | {"kind": r.kind}


def _line(label: str, v: float, low: float, high: float, note: str, cells: list[str]) -> dict[str, Any]:
    ends = {"v": _clean(v), "low": _clean(low), "high": _clean(high)}
    return {"label": one_line(label), **ends, "note": note, "cells": cells}


def answer(ranking: Ranking | None) -> dict[str, Any]:
    """Return the sentence of a group, without its name in front, its full name, and the first lines of its ranking."""
    if ranking is None:
        return {"sentence": "no solver was started.", "title": "", "head": HEAD, "lines": [], "more": 0}
    lines = [[one_line(cell) for cell in cells_of(row)] for row in ranking.shown]
    more = len(ranking.rows) - len(lines)
    return {"sentence": ranking.verdict, "title": ranking.title, "head": HEAD, "lines": lines, "more": more}


def precision(rows: pd.DataFrame, kept: pd.DataFrame) -> dict[str, Any]:
    """Return the curves of error against median time of a group, from the iterates that were kept, and their table."""
    problems = int(rows["fingerprint"].nunique())
    reached = histories.work_precision(rows, kept) if len(kept) else pd.DataFrame({"label": [], "error": []})
    head, cells = convergence.times_table(reached, problems)
    drawn = reached[np.isfinite(reached["seconds"]) & (reached["seconds"] > 0)] if len(reached) else reached
    lines = [
        {
            "label": one_line(label),
            "seconds": [float(f"{value:.4g}") for value in curve["seconds"]],
            "error": curve["error"].tolist(),
        }
        for label, curve in drawn.groupby("label")
    ]
    rows_ = [[one_line(label), *others] for label, *others in cells]
    return {"lines": lines, "head": head, "rows": rows_, "guide": convergence.guide(problems)}


def bands(rows: pd.DataFrame) -> dict[str, Any]:
    """Compute bands around the leading curves of the performance profile of the times, nothing filtered: ends at
    each τ, in the order of `labels`. No labels where no times may be compared, or where families are too few for a
    band.
    """
    compared = rows_of.only_ranked(rows)
    time = metrics.METRICS["time"]
    spent = metrics.measured(compared, time)
    times = spent.values
    if not len(times.columns):
        return {"labels": []}
    # a problem of which no time may be compared counts among those that are not solved, as in the curves
    everywhere = times.reindex(rows["fingerprint"].unique(), fill_value=math.inf)
    floor, families = time.floor or 0.0, bootstrap.families_of(rows)
    if bootstrap.clusters(everywhere.index, families)[1] < bootstrap.FEW:
        return {"labels": []}
    lost = spent.lost.reindex(everywhere.index, fill_value=False)
    leading = performance_profile(everywhere, len(everywhere), floor, lost).leading(BANDED)
    estimated = around.profile_bands(everywhere, families, labels=leading, floor=floor, lost=lost)
    ends = {
        name: end.round(DIGITS).T.to_numpy().tolist()
        for name, end in (("low", estimated.low), ("high", estimated.high))
    }
    return {
        "families": estimated.families,
        "few": estimated.few,
        "replicates": estimated.replicates,
        "taus": estimated.low.index.tolist(),
        "labels": list(estimated.low.columns),
        **ends,
    }


def growth(rows: pd.DataFrame, symbols: Sequence[str]) -> dict[str, Any]:
    """Return how the time of each label grows with each size that varies enough: ends of lines, and a table."""
    ranked = rows_of.only_ranked(rows)
    fits = {symbol: scaling.scaling(ranked, symbol) for symbol in symbols if len(ranked)}
    laws = {symbol: lines[lines["reason"] == ""] for symbol, lines in fits.items()}
    return {
        symbol: {
            "lines": [{"label": one_line(r.label), "ends": _ends(r)} for r in each(lines)],
            "head": ["solver", f"exponent of {symbol}", "95 % interval", "solved", "stopped at the limit"],
            "rows": [
                [one_line(r.label), f"{r.slope:.2f}", f"{r.low:.2f} to {r.high:.2f}", str(r.solved), str(r.stopped)]
                for r in each(lines)
            ],
        }
        for symbol, lines in laws.items()
        if len(lines)
    }


def _ends(law: Any) -> list[tuple[float, float]]:
    """Return size and time at both ends of a fitted power law."""
    sizes = (float(law.least), float(law.largest))
    return [(size, math.exp(law.intercept + law.slope * math.log(size))) for size in sizes]


def warm(table: pd.DataFrame) -> dict[str, Sheet]:
    """Return by formulation the sheet of warm starts over cold ones in the whole run, a line a label and start."""
    head = ["solver", "start", "pairs", "both solved", "only warm", "only cold", "fell back", "warm over cold"]
    sheets: dict[str, Sheet] = {}
    for r in each(starts.gains(starts.pairs(table)).sort_values("common", kind="stable")):
        counts = [str(count) for count in (r.pairs, r.both, r.only_warm, r.only_cold, r.fell_back)]
        interval = f"{number(r.common_low)} to {number(r.common_high)}"
        cells = [r.start, *counts, number(r.common), interval, number(r.all)]
        line = _line(r.label, r.common, r.common_low, r.common_high, "", cells)
        sheet = sheets.setdefault(r.node, {"head": [*head, "95 % interval", "over all pairs"], "lines": []})
        sheet["lines"].append(line | {"shown": one_line(f"{r.label} ({r.start})")})
    return sheets


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"


def _clean(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value.item() if isinstance(value, np.generic) else value
