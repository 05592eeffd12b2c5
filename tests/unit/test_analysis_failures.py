"""Reasons of failures, and claims against verdicts, on tables small enough to count by hand."""

from __future__ import annotations

import numpy as np
from synthetic_results import row, small, table

from cpbench.analysis import failures, reliability
from cpbench.analysis import table as rows_of


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
