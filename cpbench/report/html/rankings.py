"""Data of a whole group, whatever is filtered: ranking with intervals, bands around the curves of its
profile, growth with size, warm starts."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from cpbench.analysis import bands as around
from cpbench.analysis import bootstrap, means, metrics, scaling, starts, summary
from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import REFUSED
from cpbench.analysis.profiles import performance_profile
from cpbench.analysis.ranking import Ranking

Records = dict[str, list[Any]]
BANDED = 12
"""Solvers with a band: those in colour, and a few who are so when one of these is hidden for a while."""
DIGITS = 4
"""Of the fractions of bands: no screen shows more."""


def ranking(rows: pd.DataFrame) -> dict[str, Any]:
    """Rank labels, one line each, most solved first: what it solved with its interval over families, and its times."""
    times = rows_of.times(rows)
    counts = summary.solve_counts(rows, means.charge(times, means.LIMIT, rows_of.limit(rows)))
    started = rows_of.spread(rows, (~rows["status"].isin(REFUSED)).to_numpy(), False)
    rate = bootstrap.solve_rate(times, started, rows_of.lost(rows))
    around = bootstrap.intervals(rate, bootstrap.families_of(rows))
    ranking_table = counts.merge(around.table[["low", "high"]].reset_index(), on="label", how="left")
    if around.families < bootstrap.FEW:  # an interval says nothing there
        ranking_table = ranking_table.assign(low=math.nan, high=math.nan)
    columns = [
        "label",
        "kind",
        "ranked",
        "ran",
        "solved",
        "lost",
        "stationary",
        "false",
        "fastest",
        "median",
        "slowdown",
    ]
    return {
        "families": around.families,
        "few": around.families < bootstrap.FEW,
        "lines": records(ranking_table[[*columns, "mean", "low", "high"]]),
    }


def answer(ranking: Ranking | None) -> dict[str, Any]:
    """Return the sentence of a group, without its name in front, what it is called in full, and the first lines of its
    ranking."""
    if ranking is None:
        return {"sentence": "no solver was started.", "title": "", "rows": [], "more": 0}
    lines = [
        [
            *(r.solver, r.route, r.others, r.solved, r.counted, r.lost),
            *(_clean(r.median), _clean(r.factor), _clean(r.error), list(r.warnings)),
        ]
        for r in ranking.shown
    ]
    more = len(ranking.rows) - len(lines)
    return {"sentence": ranking.verdict, "title": ranking.title, "rows": lines, "more": more}


def bands(rows: pd.DataFrame) -> dict[str, Any]:
    """Compute bands around the leading curves of the performance profile of the times, nothing filtered: ends at
    each τ, in the order of `labels`. No labels where no times may be compared, or where families are too few for a
    band.
    """
    compared = rows_of.only_ranked(rows)
    time = metrics.METRICS["time"]
    spent = metrics.measured(compared, time)
    found = spent.values
    if not len(found.columns):
        return {"labels": []}
    # a problem for which nobody's time may be compared counts among those that are not solved, as in the curves
    everywhere = found.reindex(rows["fingerprint"].unique(), fill_value=math.inf)
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


def growth(rows: pd.DataFrame, symbols: Sequence[str]) -> Mapping[str, Records]:
    """Fit how the time of each label grows with each dimension that varies enough."""
    found: dict[str, Records] = {}
    ranked = rows_of.only_ranked(rows)
    for symbol in symbols:
        lines = scaling.scaling(ranked, symbol) if len(ranked) else pd.DataFrame(columns=list(scaling.COLUMNS))
        fitted = lines[lines["reason"] == ""]
        if len(fitted):
            names = ["label", "slope", "low", "high", "intercept", "solved", "stopped", "least", "largest"]
            found[symbol] = records(fitted[names])
    return found


def warm(table: pd.DataFrame) -> Records:
    """Compare warm and cold starts over the whole run, one line a formulation, label and start; no line without such
    pairs.
    """
    return records(starts.gains(starts.pairs(table)))


def records(frame: pd.DataFrame) -> Records:
    """Return columns as lists that JSON can hold: null for values that are no number, or infinite."""
    return {str(name): [_clean(value) for value in frame[name].tolist()] for name in frame}


def _clean(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value.item() if isinstance(value, np.generic) else value
