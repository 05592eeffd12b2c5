"""Counts, and warm starts beside cold ones, on tables small enough to count by hand."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from synthetic_results import row, small, suite, table
from written_reports import write_report

from cpbench.analysis import failures, histories, reliability, summary
from cpbench.analysis import table as rows_of
from cpbench.analysis.ranking import rankings
from cpbench.analysis.starts import paired
from cpbench.errors import StoreError
from cpbench.report import tables

INF = math.inf


def test_time_is_of_verified_answers_only() -> None:
    rows = small()
    assert rows_of.times(rows).to_numpy().tolist() == [[1.0, 4.0, INF], [INF, 9.0, INF], [INF, INF, INF]]
    parts = table(row("p", "s", "solved", 1.0, convert=0.25, setup=0.5, lift=0.125, load=99.0, verify=99.0))
    assert rows_of.with_time(parts)["time"].tolist() == [1.875]
    assert rows_of.with_time(table(row("p", "s", "solved")))["time"].tolist() == [INF], "not timed"


def test_a_quantile_says_how_many_are_late() -> None:
    """p99 ≤ D exactly when at most 1 % took longer than D or failed; where all is finite it is numpy's."""
    rng = np.random.default_rng(1)
    times = pd.DataFrame(rng.lognormal(size=(200, 40)))
    whole = np.quantile(times, 0.95, axis=0, method="inverted_cdf")
    assert summary.quantile(times, 0.95).tolist() == whole.tolist()
    times[times > rng.uniform(2, 30, 40)] = INF
    p99 = summary.quantile(times, 0.99)
    for limit in (0.5, 2.0, 10.0, 25.0):
        assert ((p99 <= limit) == ((times > limit).sum() <= 2)).all()
    assert summary.quantile(pd.DataFrame({"s": np.arange(1.0, 101.0)}), 0.07).tolist() == [7.0]


def test_failures_stay_among_the_times() -> None:
    """Two failures of a hundred: p95 is the 95th time, p99 is infinite."""
    rows = [row(f"p-{k}", "s", "solved", k / 1000) for k in range(1, 99)]
    rows += [row(f"p-{k}", "s", "timeout") for k in (99, 100)]
    times = rows_of.times(rows_of.normalised(table(*rows)))
    assert [summary.quantile(times, share)["s"] for share in (0.95, 0.99)] == [0.095, INF]


def half_stationary() -> pd.DataFrame:
    """s solves p and is stationary on q, faster than t, which solves both."""
    stationary = row("q", "s", "stationary", 1.0, claim="solved", flags="stationary", error=1e-9)
    solved = [row("p", "s", "solved", 1.0), *(row(name, "t", "solved", 4.0) for name in "pq")]
    return rows_of.normalised(table(stationary, *solved))


def test_stationary_is_a_column_of_its_own() -> None:
    """It is in no time, rank or mean; it is no false claim and no failure either."""
    rows = half_stationary()
    (found,) = rankings(rows)
    assert [(one.solver, one.solved, one.stationary, one.false, one.fastest) for one in found.rows] == [
        ("s", 1, 1, 0, 1),
        ("t", 2, 0, 0, 1),
    ]
    assert rows_of.times(rows)["s"].tolist() == [1.0, INF]
    assert rows_of.met(rows).all()
    assert failures.failures(rows) == []
    assert reliability.claim_counts(rows).loc["s", ["made", "confirmed"]].tolist() == [2, 2]


def test_stationary_counts_as_solved_where_that_is_environment() -> None:
    rows = rows_of.counting_stationary(half_stationary())
    (found,) = rankings(rows)
    assert (found.rows[0].solver, found.rows[0].solved, found.rows[0].fastest) == ("s", 2, 2)
    assert rows["flags"].tolist().count("stationary counted as solved") == 1, "what it is stays in the row"


def test_verdicts_sum_to_the_rows() -> None:
    rows = rows_of.normalised(suite(20, 12))
    found = summary.verdicts(rows)
    assert int(found.to_numpy().sum()) == len(rows)
    assert list(found.columns) == [s for s in rows_of.STATUSES if s in set(rows["status"])]


def test_families_and_the_hardest_problems() -> None:
    rows = small()
    family = summary.families(rows).set_index("family")
    assert family["solved"].to_dict() == {"a": 3, "b": 0}
    assert family["best"].to_dict() == {"a": ["pgs"], "b": []}
    hardest = failures.hardest(rows)
    assert hardest[["name", "solved", "started", "error", "label"]].to_numpy().tolist() == [["b-1", 0, 3, 3e-5, "pgs"]]


def test_groups_keep_settings_apart() -> None:
    rows = rows_of.normalised(
        table(
            row("p", "s", "solved", 1.0),
            row("p", "s", "wrong", 1.0, tolerance=1e-8, key="2"),
            row("p", "s", "solved", 1.0, threads=2, key="3"),
        )
    )
    assert [(g.tolerance, g.threads, len(part)) for g, part in rows_of.groups(rows)] == [
        (1e-8, 1, 1),
        (1e-6, 1, 1),
        (1e-6, 2, 1),
    ]
    with pytest.raises(StoreError, match="p, s: two rows"):
        rows_of.times(rows)


def test_nothing_changes_its_input_and_order_does_not_matter() -> None:
    rows = suite(12, 8)
    before = rows.copy()
    clean = rows_of.normalised(rows)
    kept = clean.copy()
    results = [reliability.claim_counts(clean), summary.verdicts(clean), summary.families(clean)]
    results.append(failures.hardest(clean))
    pd.testing.assert_frame_equal(rows, before)
    pd.testing.assert_frame_equal(clean, kept)
    mixed = rows_of.normalised(rows.sample(frac=1.0, random_state=3))
    pd.testing.assert_frame_equal(mixed, clean)
    again = [reliability.claim_counts(mixed), summary.verdicts(mixed), summary.families(mixed)]
    again.append(failures.hardest(mixed))
    for one, two in zip(results, again, strict=True):
        pd.testing.assert_frame_equal(one, two)


def test_an_empty_table_has_empty_answers() -> None:
    for rows in (rows_of.normalised(table()), rows_of.normalised(pd.DataFrame())):
        assert rows_of.groups(rows) == []
        assert reliability.false_claims(rows).empty
        assert failures.flagged(rows, "direction").empty
        assert failures.failures(rows) == []
        assert reliability.inexact_routes(rows).empty
        assert failures.hardest(rows).empty


def _counted(count: int) -> str:
    return json.dumps({"iterations": count})


def test_pairs_are_compared_where_both_solved() -> None:
    """Ratios 1/2 and 1/8 have the geometric mean 1/4; a step that fell back and one that failed are only counted."""
    cold = [row(f"p-{i}", "s", "solved", 8.0, counters=_counted(16)) for i in range(4)]
    warm = [
        row("p-0", "s", "solved", 4.0, start="previous", started="previous", counters=_counted(0)),
        row("p-1", "s", "solved", 1.0, start="previous", started="previous", counters=_counted(4)),
        row("p-2", "s", "solved", 8.0, start="previous", started="cold: first step", counters=_counted(16)),
        row("p-3", "s", "timeout", 10.0, start="previous", started="previous"),
    ]
    (found,) = paired(rows_of.normalised(table(*cold, *warm))).to_dict("records")
    assert (found["pairs"], found["warm"], found["cold"], found["fell_back"]) == (4, 3, 4, 1)
    assert found["time"] == pytest.approx(0.25)
    assert found["iterations"] == pytest.approx(math.sqrt(1 / 16 * 4 / 16)), "0 iterations count as 1"


def test_settings_are_not_mixed() -> None:
    cold = row("p-0", "s", "solved", 1.0)
    warm = row("p-0", "s", "solved", 1.0, start="file", started="file", tolerance=1e-8)
    assert paired(rows_of.normalised(table(cold, warm))).empty


def test_without_warm_rows_there_is_nothing() -> None:
    rows = rows_of.normalised(table(row("p-0", "s", "solved", 1.0)))
    assert paired(rows).empty


def _path(key: str, *steps: tuple[float, float]) -> pd.DataFrame:
    """Iterates (time, error) of a row whose recorded solve took 4 s."""
    time, error = (np.array(column) for column in zip(*steps, strict=True))
    return pd.DataFrame(
        {"key": key, "time": time, "iteration": time, "residual": 0.0, "error": error, "share": time / 4.0}
    )


ROWS = table(
    row("p", "fast", "solved", 4.0),
    row("p", "slow", "solved", 8.0, convert=1.0, setup=0.5, lift=0.25),
    row("p", "mute", "solved", 0.1),
    row("q", "fast", "solved", 4.0),
    row("q", "slow", "failed", 8.0, convert=1.0, setup=0.5, lift=0.25),
    row("q", "mute", "solved", 0.1),
)
PATHS = pd.concat(
    [
        _path("p/fast", (0.0, 1.0), (1.0, 1e-2), (2.0, 1e-4), (4.0, 1e-8)),
        _path("p/slow", (0.0, 1.0), (2.0, 1e-2), (3.0, 1e-1), (4.0, 1e-8)),
        _path("q/fast", (0.0, 1.0), (3.0, 1e-2), (4.0, 1e-8)),
        _path("q/slow", (0.0, 1.0), (4.0, 0.5)),
        _path("elsewhere", (0.0, 0.0)),
    ],
    ignore_index=True,
)


def test_times_are_shares_of_the_timed_solve_with_what_comes_before_and_after() -> None:
    seconds = histories.charged(ROWS, PATHS).set_index(["label", "fingerprint", "time"])["seconds"]
    assert seconds["slow", "f-p"].max() == 1.0 * 8.0 + 1.75


def test_without_any_history_there_is_nothing() -> None:
    none = PATHS.iloc[:0]
    assert not len(histories.work_precision(ROWS, none))
    assert not len(tables.precision(ROWS, none))


def test_medians_count_what_was_not_reached() -> None:
    found = histories.work_precision(ROWS, PATHS).itertuples(index=False)
    at = {(r.label, r.error): (r.reached, r.seconds) for r in found}
    assert at["fast", 1e-2] == (2, 2.0)
    assert at["fast", 1e-6] == (2, 4.0)
    assert at["slow", 1.0] == (2, 1.75)
    assert at["slow", 1e-2] == (1, math.inf)
    assert min(error for _, error in at) == 1e-6  # the tolerance of the rows
    assert {label for label, _ in at} == {"fast", "slow"}


def test_the_table_counts_what_was_reached() -> None:
    assert [row[:4] for row in tables.precision(ROWS, PATHS).cells()] == [
        ["`fast`", "2 s", "3 s", "4 s"],
        ["`slow`", "∞ (1)", "∞ (1)", "∞ (1)"],
    ]


def test_a_report_shows_the_histories_it_is_given(tmp_path: Path) -> None:
    write_report(ROWS, {}, tmp_path / "with", "t", PATHS)
    write_report(ROWS, {}, tmp_path / "without", "t")
    assert "### Error against time" in (tmp_path / "with" / "details.md").read_text()
    assert "### Error against time" not in (tmp_path / "without" / "details.md").read_text()
