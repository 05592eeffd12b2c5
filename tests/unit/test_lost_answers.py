"""Answers that a conversion lost are charged to it: no number of the solver has them."""

from __future__ import annotations

import math

import pandas as pd
import pytest
from synthetic_results import row

from cpbench.analysis import best, bootstrap, means, metrics, profiles
from cpbench.analysis import table as rows_of
from cpbench.analysis.ranking import rankings

LOST = {2, 3}
"""Problems of ten whose answers are lost; the solver fails on one more, and solves seven."""


def _rows() -> pd.DataFrame:
    status = {**dict.fromkeys(LOST, "lost"), 5: "failed"}
    one = [row(f"{k}-p", "osqp", status.get(k, "solved"), 1.0 + k, route="lcp-qp") for k in range(10)]
    return rows_of.normalised(pd.DataFrame([*one, *(row(f"{k}-p", "lemke", "solved", 2.0) for k in range(10))]))


def test_curves_end_at_the_share_of_what_was_not_lost() -> None:
    group = _rows()
    times, lost = rows_of.times(group), rows_of.lost(group)
    lemke, osqp = profiles.performance_profile(times, lost=lost).curves
    assert (lemke.at(math.inf), osqp.at(math.inf)) == (1.0, 7 / 8)
    assert metrics.measured(group, metrics.METRICS["time"]).lost.equals(lost)


def test_means_are_those_without_the_pairs() -> None:
    group = _rows()
    times, lost = rows_of.times(group), rows_of.lost(group)
    alone = times.loc[~lost["osqp"], ["osqp"]]
    found = means.means(times, shift=0.5, limit=60.0, lost=lost).mean["osqp"]
    assert found == pytest.approx(means.means(alone, shift=0.5, limit=60.0).mean["osqp"], rel=1e-12)


def test_intervals_are_those_without_the_pairs() -> None:
    """Families of one problem each: what is left out of a family leaves the family out."""
    group = _rows()
    times, lost = rows_of.times(group), rows_of.lost(group)
    mean = bootstrap.mean_time(times, 0.5, 60.0, lost).at["osqp", "estimate"]
    assert mean == pytest.approx(means.means(times, shift=0.5, limit=60.0, lost=lost).mean["osqp"])


def test_tables_count_them_by_themselves() -> None:
    group = _rows()
    (found,) = rankings(group)
    osqp = next(one for one in found.rows if one.solver == "osqp")
    assert (osqp.started, osqp.counted, osqp.solved, osqp.lost) == (10, 8, 7, 2)
    gap = best.gaps(rows_of.times(group), lost=rows_of.lost(group)).loc["osqp"]
    assert (gap["planned"], gap["solved"]) == (8, 7)
