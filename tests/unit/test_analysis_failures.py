"""Reasons of failures on tables small enough to count by hand."""

from __future__ import annotations

from synthetic_results import row, table

from cpbench.analysis import failures
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
