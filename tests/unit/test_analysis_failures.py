"""Reasons of failures, claims against verdicts, answers that a conversion lost, on tables to be counted by hand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from synthetic_results import meta, row, small, table
from written_reports import whole, write_report

from cpbench.analysis import bootstrap, failures, means, metrics, profiles, reliability
from cpbench.analysis import table as rows_of
from cpbench.analysis.ranking import rankings
from cpbench.analysis.reliability import NEAR, claim_counts, near
from cpbench.analysis.table import normalised


def test_a_problem_without_a_solution_is_not_hard() -> None:
    rows = table(row("p", "a", "infeasible", 1.0), row("p", "b", "max_iter", 1.0), row("q", "b", "max_iter", 1.0))
    assert failures.hardest(rows_of.normalised(rows))["name"].tolist() == ["q"]


def test_failures_are_listed_once_a_reason() -> None:
    rows = rows_of.normalised(
        table(
            row("p-1", "a", "error", message="singular at pivot 17"),
            row("p-2", "a", "error", message="singular at pivot 3"),
            row("p-1", "b", "error", message="singular at pivot 1e-5"),
            row("p-1", "c", "error", message="no such file 'x'"),
            row("p-1", "d@inner8", "wrong", 1.0),
            row("p-1", "e", "wrong", 1.0),
            row("p-1", "f", "unavailable", message="missing"),
            row("p-1", "g", "solved", 1.0),
        )
    )
    found = failures.failures(rows)
    assert [(r.status, r.kind, r.count, dict(r.labels)) for r in found] == [
        ("wrong", "", 1, {"e": 1}),
        ("wrong", "approximate", 1, {"d@inner8": 1}),
        ("error", "", 3, {"a": 2, "b": 1}),
        ("error", "", 1, {"c": 1}),
    ]
    assert (found[2].message, found[2].example["problem"]) == ("singular at pivot 17", "p-1")
    assert [r.status for r in failures.failures(rows, refused=True)] == ["unavailable"]
    everything = failures.failures(rows) + failures.failures(rows, refused=True)
    assert sum(r.count for r in everything) == len(rows) - 1


def test_claims_and_false_claims() -> None:
    rows = small()
    untrue = reliability.false_claims(rows)
    assert list(zip(untrue["problem"], untrue["label"], strict=True)) == [("a-2", "lemke"), ("b-1", "pgs")]
    measured = rows.assign(target_error=rows["error"].where(rows["label"] == "pgs@inner8"))
    untrue = reliability.false_claims(measured)
    assert untrue["label"].tolist() == ["pgs@inner8", "lemke", "pgs"], "wrong on the facets too: that is the solver"
    timeout = table(row("p", "s", "timeout", claim="solved"))
    assert reliability.false_claims(rows_of.normalised(timeout)).empty, "killed or late: the limit decided, not a lie"


def test_inexact_routes() -> None:
    found = reliability.inexact_routes(small())
    assert found[["label", "kind", "pairs", "solved", "missed"]].to_numpy().tolist() == [
        ["pgs@inner8", "approximate", 2, 0, 1]
    ]
    assert found["median"].tolist() == [0.2]
    rows = small()
    for there, missed in ((1e-9, 1), (1e-3, 0)):  # the route's error, or the solver's
        measured = rows.assign(target_error=np.where(rows["key"] == "a-1/pgs@inner8", there, np.nan))
        assert reliability.inexact_routes(measured)["missed"].tolist() == [missed]


def _rows() -> pd.DataFrame:
    return pd.DataFrame(
        [
            row("a", "mine", "solved", 1.0),
            row("b", "mine", "inaccurate", 1.0, error=1.2e-6),  # within twice the tolerance of 1e-6
            row("c", "mine", "inaccurate", 1.0, error=2.2e-6),
            row("d", "mine", "wrong", 1.0),
            row("e", "mine", "failed", 1.0, claim="failed"),  # no claim
            row("f", "mine", "lost", 1.0, claim="solved", error=0.5, target_error=1e-7, target_tolerance=1e-6),
            # the error on its own problem decides, not that on the asked one
            row("g", "mine", "inaccurate", 1.0, error=1e-3, target_error=1.5e-7, target_tolerance=1e-7),
            row("a", "guest", "failed", 1.0, claim="infeasible"),  # `mine` has an answer
            row("e", "guest", "failed", 1.0, claim="infeasible"),
            row("h", "guest", "infeasible", 1.0, claim="infeasible"),
            row("b", "guest", "unresolvable", 1.0, claim="solved"),
        ]
    )


def test_every_claim_is_in_one_column() -> None:
    found = claim_counts(normalised(_rows()))
    columns = ["made", "confirmed", "near", "false", "nonexistence", "open"]
    assert found.loc["mine", columns].tolist() == [6, 2, 2, 2, 0, 0]
    assert found.loc["guest", columns].tolist() == [4, 1, 0, 0, 1, 2]


@pytest.mark.parametrize(("factor", "is_near"), [(1.0, False), (1.01, True), (1.99, True), (2.01, False), (4.0, False)])
def test_near_ends_at_twice_the_tolerance(factor: float, is_near: bool) -> None:
    rows = normalised(pd.DataFrame([row("a", "s", "inaccurate", 1.0, error=factor * 1e-6)]))
    assert near(rows).tolist() == [is_near]
    assert NEAR == 2.0


def test_the_report_has_the_solvers_of_cpbench_first(tmp_path: Path) -> None:
    about = meta(solvers={"mine": {"name": "mine", "native": True}, "guest": {"name": "guest"}})
    text = whole(write_report(_rows(), about, tmp_path, "run"))
    head = "| solver | claims made | confirmed | near | false | false: no solution | undecided |"
    lines = text[text.index(head) :].splitlines()
    assert lines[2:4] == ["| `mine` | 6 | 2 | 2 | 2 | · | · |", "| `guest` | 4 | 1 | · | · | 1 | 2 |"]


LOST = {2, 3}
"""Problems of ten whose answers are lost; the solver fails on one more, and solves seven."""


def _lost_rows() -> pd.DataFrame:
    status = {**dict.fromkeys(LOST, "lost"), 5: "failed"}
    one = [row(f"{k}-p", "osqp", status.get(k, "solved"), 1.0 + k, route="lcp-qp") for k in range(10)]
    return rows_of.normalised(pd.DataFrame([*one, *(row(f"{k}-p", "lemke", "solved", 2.0) for k in range(10))]))


def test_curves_end_at_the_share_of_what_was_not_lost() -> None:
    group = _lost_rows()
    times, lost = rows_of.times(group), rows_of.lost(group)
    lemke, osqp = profiles.performance_profile(times, lost=lost).curves
    assert (lemke.at(math.inf), osqp.at(math.inf)) == (1.0, 7 / 8)
    assert metrics.measured(group, metrics.METRICS["time"]).lost.equals(lost)


def test_means_are_those_without_the_pairs() -> None:
    group = _lost_rows()
    times, lost = rows_of.times(group), rows_of.lost(group)
    alone = times.loc[~lost["osqp"], ["osqp"]]
    found = means.means(times, shift=0.5, limit=60.0, lost=lost).mean["osqp"]
    assert found == pytest.approx(means.means(alone, shift=0.5, limit=60.0).mean["osqp"], rel=1e-12)


def test_intervals_are_those_without_the_pairs() -> None:
    """Families of one problem each: what is left out of a family leaves the family out."""
    group = _lost_rows()
    times, lost = rows_of.times(group), rows_of.lost(group)
    mean = bootstrap.mean_time(times, 0.5, 60.0, lost).at["osqp", "estimate"]
    assert mean == pytest.approx(means.means(times, shift=0.5, limit=60.0, lost=lost).mean["osqp"])


def test_tables_count_them_by_themselves() -> None:
    group = _lost_rows()
    (found,) = rankings(group)
    osqp = next(one for one in found.rows if one.solver == "osqp")
    assert (osqp.started, osqp.counted, osqp.solved, osqp.lost) == (10, 8, 7, 2)
    gap = means.gaps(rows_of.times(group), lost=rows_of.lost(group)).loc["osqp"]
    assert (gap["planned"], gap["solved"]) == (8, 7)
