"""Contradictions of a run by its claims, in its results, its report and a comparison."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import pytest
from command_line import cpbench as command
from synthetic_results import meta, results_file, row, table
from written_reports import whole, write_report

from cpbench.analysis import ranking, reliability
from cpbench.analysis.comparison import ComparisonSide, compare, compare_labels
from cpbench.analysis.contradictions import Contradiction, of_claims
from cpbench.analysis.table import normalised
from cpbench.api import concluding
from cpbench.bench.results.store import Store


def denied(claim: str = "infeasible", **given: object) -> dict[str, object]:
    return row("p", "denier", "failed", 1.0) | {"claim": claim, **given}


def contradicted(*rows: dict[str, object]) -> list[str]:
    return [one.words for one in of_claims(normalised(table(*rows)))]


def test_a_claim_of_no_solution_beside_a_verified_answer() -> None:
    words = "denier claims that it is infeasible; lemke has a verified answer."
    assert contradicted(row("p", "lemke", "solved", 1.0), denied()) == [words]
    assert len(contradicted(row("p", "lemke", "solved", 1.0), denied("unbounded"))) == 1
    proved = "it is proved to be infeasible (row of denier); lemke has a verified answer."
    assert contradicted(row("p", "lemke", "solved", 1.0), denied(status="infeasible")) == [proved]


@pytest.mark.parametrize(
    ("answer", "claim"),
    [
        ({}, {"kind": "one-way"}),  # its target may have no solution
        ({"tolerance": 1e-4}, {}),  # a looser answer exists where a tighter one does not
        ({"measure": "natural"}, {}),
        ({"status": "wrong"}, {}),
        ({"status": "stationary"}, {"claim": "unbounded"}),
        ({}, {"claim": "failed"}),
        ({"problem": "q", "fingerprint": "f-q"}, {}),
    ],
)
def test_what_contradicts_no_claim(answer: dict[str, object], claim: dict[str, object]) -> None:
    assert contradicted(row("p", "lemke", "solved", 1.0) | answer, denied() | claim) == []


def test_false_claims_of_no_solution_count() -> None:
    rows = normalised(
        table(
            row("p", "lemke", "solved", 1.0),
            denied(),
            row("q", "denier", "solved", 1.0),
            row("r", "denier", "failed", 1.0, claim="infeasible"),
        )
    )
    found = reliability.claim_counts(rows).loc["denier"]
    assert found[["made", "confirmed", "nonexistence", "open"]].tolist() == [3, 1, 1, 1]
    assert reliability.false_claims(rows)["label"].tolist() == ["denier"]
    assert reliability.unproved(rows)["problem"].tolist() == ["r"]
    (group,) = ranking.rankings(rows)
    assert "claims that fail 1" in next(one for one in group.rows if one.solver == "denier").warnings


def test_a_group_of_rows_keeps_what_others_contradict() -> None:
    """The answer was found from another start, whose rows are a group of their own."""
    rows = normalised(table(row("p", "lemke", "solved", 1.0, start="previous"), denied()))
    assert reliability.claim_counts(rows[rows["start"] == "cold"]).loc["denier", "nonexistence"] == 1


def test_a_solved_problem_is_not_left_out_of_the_ranking_for_a_proof() -> None:
    rows = normalised(table(row("p", "lemke", "solved", 1.0), denied(status="infeasible")))
    (group,) = ranking.rankings(rows)
    assert group.problems == 1
    assert "no solution" not in group.sentence


def test_a_report_says_what_is_not_proved(tmp_path: Path) -> None:
    text = whole(write_report(table(denied()), meta(), tmp_path, "run"))
    assert "1 claim that there is no solution: neither proved, nor contradicted by a verified answer" in text
    assert "No claim of a solver is known to be false." in text


def test_files_that_are_merged_contradict_each_other(tmp_path: Path) -> None:
    results_file(tmp_path / "a.sqlite", table(row("p", "lemke", "solved", 1.0)))
    results_file(tmp_path / "b.sqlite", table(denied()))
    done = command(tmp_path, "results", "merge", "a.sqlite", "b.sqlite", "-o", "both.sqlite")
    assert "denier claims that it is infeasible" in done.stdout, done.stderr
    with Store(tmp_path / "both.sqlite") as store:
        assert [one["kind"] for one in store.meta()["contradictions"]] == ["existence"]


def test_without_the_laboratory_claims_are_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(concluding, "added", lambda group: {})
    path = results_file(tmp_path / "r.sqlite", table(row("p", "lemke", "solved", 1.0), denied()))
    with Store(path, create=True) as store:
        assert [one.kind for one in concluding.conclude(store)] == ["existence"]
        assert [one["kind"] for one in store.meta()["contradictions"]] == ["existence"]


def side(name: str, status: str, found: Sequence[Contradiction]) -> ComparisonSide:
    rows = table(row("p", "a", "solved", 1.0), row("p", "b", status, 1.0))
    return ComparisonSide(name, rows, meta(contradictions=[dataclasses.asdict(one) for one in found]))


def test_a_comparison_counts_new_contradictions() -> None:
    known = Contradiction("existence", "p", "f-p", ("p/b", "p/a"), ("b", "a"), "b claims that it is infeasible.")
    none, same = side("old", "solved", []), side("old", "failed", [known])
    new = side("new", "failed", [known])
    assert compare(none, new).failures(["contradiction"]) == {"new contradiction": 1}
    assert compare(same, new).failures(["contradiction"]) == {}
    assert compare(side("old", "wrong", [known]), new).failures(["contradiction"]) == {"new contradiction": 1}
    assert compare_labels(new, "a", "b").failures(["contradiction"]) == {"new contradiction": 1}
