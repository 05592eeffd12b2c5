"""Answers that a conversion lost are charged to it: no number of the solver has them."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from synthetic_results import row

from cpbench.analysis import bands, best, bootstrap, data_profiles, means, metrics, profiles, reliability, summary
from cpbench.analysis import table as rows_of

LOST = {2, 3}
"""Problems of ten whose answers are lost; the solver fails on one more, and solves seven."""


def _rows() -> pd.DataFrame:
    status = {**dict.fromkeys(LOST, "lost"), 5: "failed"}
    one = [row(f"{k}-p", "osqp", status.get(k, "solved"), 1.0 + k, route="lcp-qp") for k in range(10)]
    return rows_of.normalised(pd.DataFrame([*one, *(row(f"{k}-p", "lemke", "solved", 2.0) for k in range(10))]))


def _without() -> pd.DataFrame:
    """The rows as they would be, had the pairs with lost answers not been planned."""
    rows = _rows()
    return rows[rows["status"] != "lost"].reset_index(drop=True)


def test_curves_end_at_the_share_of_what_was_not_lost() -> None:
    group = _rows()
    times, lost = rows_of.times(group), rows_of.lost(group)
    for profile in (profiles.performance_profile(times, lost=lost), data_profiles.data_profile(times, lost=lost)):
        lemke, osqp = profile.curves
        assert (lemke.at(math.inf), osqp.at(math.inf)) == (1.0, 7 / 8)
    assert metrics.measured(group, metrics.METRICS["time"]).lost.equals(lost)


def test_means_are_those_without_the_pairs() -> None:
    group = _rows()
    times, lost = rows_of.times(group), rows_of.lost(group)
    alone = times.loc[~lost["osqp"], ["osqp"]]
    for kind in ("geometric", "arithmetic", "median"):
        found = means.means(times, shift=0.5, limit=60.0, kind=kind, lost=lost).table.loc["osqp"]  # type: ignore[arg-type]
        expected = means.means(alone, shift=0.5, limit=60.0, kind=kind).table.loc["osqp", "mean"]  # type: ignore[arg-type]
        assert found["mean"] == pytest.approx(expected, rel=1e-12)  # pyright: ignore[reportGeneralTypeIssues]
        assert (found["planned"], found["solved"], found["charged"], found["lost"]) == (10, 7, 1, 2)


def test_intervals_are_those_without_the_pairs() -> None:
    """Families of one problem each: what is left out of a family leaves the family out."""
    group = _rows()
    times, lost = rows_of.times(group), rows_of.lost(group)
    rate = bootstrap.intervals(bootstrap.solve_rate(times, lost=lost)).table.loc["osqp"]
    assert (float(rate["estimate"]), int(rate["problems"])) == (7 / 8, 8)
    mean = bootstrap.intervals(bootstrap.mean_time(times, 0.5, 60.0, lost)).table.loc["osqp", "estimate"]
    assert mean == pytest.approx(means.means(times, shift=0.5, limit=60.0, lost=lost).table.loc["osqp", "mean"])
    band = bands.profile_bands(times, taus=[1e3], lost=lost)
    assert band.estimate["osqp"].tolist() == [7 / 8]
    assert float(band.low["osqp"].iloc[0]) <= 7 / 8 <= float(band.high["osqp"].iloc[0])


def test_tables_count_them_by_themselves() -> None:
    group = _rows()
    counts = summary.solve_counts(group, 60.0).set_index("label").loc["osqp"]
    assert (counts["ran"], counts["solved"], counts["lost"]) == (10, 7, 2)
    gap = best.gaps(rows_of.times(group), lost=rows_of.lost(group)).loc["osqp"]
    assert (gap["planned"], gap["solved"]) == (8, 7)
    found = reliability.reliability(group).loc["osqp"]
    assert float(found["rate"]) == 7 / 8  # type: ignore[arg-type]
    assert reliability.reliability(_without()).loc["osqp", ["rate", "rate_low", "rate_high"]].tolist() == (
        found[["rate", "rate_low", "rate_high"]].tolist()
    )


def test_nothing_changes_where_nothing_is_lost() -> None:
    rows = _without()
    group = rows[rows["label"] == "lemke"]
    times, lost = rows_of.times(group), rows_of.lost(group)
    assert not np.asarray(lost).any()
    assert means.means(times, limit=9.0, lost=lost).table.equals(means.means(times, limit=9.0).table)
