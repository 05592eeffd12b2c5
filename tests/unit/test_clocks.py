"""Clocks of served solvers, and what makes times unfit for a comparison."""

from __future__ import annotations

import math

import pandas as pd
import pytest
from synthetic_results import meta, row, table

from cpbench.analysis import cautions
from cpbench.analysis import table as rows_of
from cpbench.analysis.ranking import rankings
from cpbench.bench.outcome import LATE, LATE_SHARE, method_seconds


def test_a_method_in_the_worker_has_the_clock_of_the_worker() -> None:
    assert method_seconds(2.0, 0.5, None, trusted=True) == 2.0


def test_the_clock_of_a_guest_counts_where_it_is_plausible() -> None:
    assert method_seconds(7.24e-3, 0.65e-3, 5e-5, trusted=True) == 0.65e-3
    for implausible in (None, 0.0, -1.0, 8e-3, math.nan):
        assert method_seconds(7.24e-3, implausible, 5e-5, trusted=True) == pytest.approx(7.19e-3)


def test_a_clock_that_shows_far_too_little_is_not_believed() -> None:
    """From both sides of what the flag `clock` allows: a quarter of a second, and half of the time."""
    reported = 1.0
    most = LATE + LATE_SHARE * reported
    assert method_seconds(0.999 * most, reported, 0.01, trusted=True) == reported
    assert method_seconds(1.001 * most, reported, 0.01, trusted=True) == pytest.approx(1.001 * most - 0.01)


def test_what_a_program_of_others_reports_is_its_claim() -> None:
    assert method_seconds(0.5, 1e-9, 0.01, trusted=False) == 0.49
    assert method_seconds(0.005, 1e-9, 0.01, trusted=False) == 0.0


def test_a_served_solver_is_marked_with_its_round_trip() -> None:
    rows = rows_of.normalised(
        pd.DataFrame([*(row(p, "guest", "solved", 1.0, trip=5e-5) for p in "ab"), row("a", "own", "solved", 1.0)])
    )
    [found] = rankings(rows)
    assert {one.solver: one.warnings for one in found.rows} == {"guest": ("served (round trip 50 µs)",), "own": ()}


def _loaded(loads: list[float]) -> pd.DataFrame:
    return rows_of.normalised(table(*(row(str(k), "s", "solved", 1.0) for k in range(len(loads))))).assign(
        loadavg=loads
    )


@pytest.mark.parametrize(("busy", "said"), [(0, False), (1, False), (2, True), (4, True)])
def test_a_load_beyond_the_cores_is_reported_from_a_tenth_of_the_rows(busy: int, said: bool) -> None:
    found = cautions.disturbance(_loaded([2.5] * busy + [2.0] * (20 - busy)), {"machine": {"threads": 2}})
    assert bool(found) == said
    assert (f"beyond the 2 cores at {busy} of 20 pairs (up to 2.5)" in found) == said


@pytest.mark.parametrize(("drift", "said"), [(1.0, False), (1.45, False), (1.55, True), (3.0, True)])
def test_a_drift_of_the_machine_is_reported_beyond_a_half(drift: float, said: bool) -> None:
    about = meta(references=[{"seconds": 0.01}, {"seconds": 0.01 * drift}, {"seconds": None}])
    assert bool(cautions.disturbance(_loaded([1.0]), about)) == said
