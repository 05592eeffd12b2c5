"""Rankings of rows made up, so small that each number can be counted by hand."""

from __future__ import annotations

import math

import pandas as pd
import pytest
from synthetic_results import row, table

from cpbench.analysis import table as rows_of
from cpbench.analysis.ranking import LAUNCHES, LINES, Ranking, rankings
from cpbench.formulations import formulations
from cpbench.report.overview_figure import PANELS, chosen


def _ranked(*rows: dict[str, object], sheets: dict[str, dict[str, object]] | None = None) -> list[Ranking]:
    return rankings(rows_of.normalised(pd.DataFrame(list(rows))), sheets)


def test_the_fastest_of_a_tier_comes_first() -> None:
    [found] = _ranked(
        *(row(p, "steady", "solved", 4.0) for p in "abc"),
        *(row(p, "quick", "solved", 1.0) for p in "ab"),
        row("c", "quick", "failed", 0.1),
        *(row(p, "slow", "solved", 8.0) for p in "abc"),
    )
    # a miss of three costs the limit of 10 s: 2.2 s on average are less than 4 s
    assert [r.solver for r in found.rows] == ["quick", "steady", "slow"]
    quick, steady, slow = found.rows
    assert (steady.solved, steady.started, steady.fastest, steady.median) == (3, 3, 1, 4.0)
    assert steady.factor == pytest.approx(16 ** (1 / 3))  # 4, 4 and 1 times the fastest
    assert slow.factor == pytest.approx(128 ** (1 / 3))  # 8, 8 and 2 times
    assert (quick.solved, quick.started, quick.fastest, quick.factor) == (2, 3, 2, 1.0)
    assert found.sentence == (
        "lcp: a hint from 3 problems: quick solves 2 of 3, 4 times faster than steady, one of 2 with 3; "
        "it missed c (failed)."
    )


@pytest.mark.parametrize("status", ["unsupported", "unavailable", "not_run"])
def test_pairs_not_started_count_against_no_solver(status: str) -> None:
    [found] = _ranked(
        *(row(p, "all", "solved", 1.0) for p in "ab"),
        row("a", "some", "solved", 1.0),
        row("b", "some", status),
        row("a", "none", status),
        row("b", "none", status),
    )
    assert {r.solver: (r.solved, r.started) for r in found.rows} == {"all": (2, 2), "some": (1, 1)}
    assert found.problems == 2


def test_a_ranking_names_its_formulation_and_its_winner() -> None:
    [found] = _ranked(row("a", "one", "solved", 1.0), row("a", "two", "failed", 1.0))
    assert (found.bracketed_title, found.winner, found.problems_and_starts) == (
        " (linear complementarity problem)",
        "one",
        "1 problem",
    )
    assert found.verdict == "a hint from 1 problem: one solves 1 of 1, alone on 1."
    [none] = _ranked(row("a", "one", "failed", 1.0), row("a", "two", "failed", 1.0))
    assert none.winner == ""


def test_the_figure_of_a_run_has_the_formulations_that_compare_most() -> None:
    """Not the first by name: the last of them has most problems, the first but one solver."""
    nodes = sorted(formulations.names())
    assert len(nodes) > PANELS + 1
    rows = [row("a", label, "solved", 1.0) | {"node": node} for node in nodes[1:] for label in ("one", "two")]
    rows += [row(p, "one", "solved", 1.0) | {"node": nodes[0]} for p in "abc"]
    rows += [row("b", "one", "solved", 1.0) | {"node": nodes[-1]}]
    assert [r.group.node for r in chosen(_ranked(*rows))] == [*nodes[1:PANELS], nodes[-1]]
    assert chosen(_ranked(*rows[-4:-1])) == [], "a curve alone says no more than the ranking"


def test_a_group_without_started_pairs_has_no_ranking() -> None:
    assert _ranked(row("a", "some", "unavailable")) == []
    assert rankings(rows_of.normalised(table())) == []


def test_the_leader_of_a_part_of_the_problems_says_so() -> None:
    [found] = _ranked(
        row("a", "some", "solved", 1.0),
        row("b", "some", "unsupported"),
        *(row(p, "all", "failed", 1.0) for p in "ab"),
    )
    assert found.sentence == "lcp: a hint from 2 problems: some solves 1 of 1 (2 problems in all), alone on 1."


def test_warnings_are_counted() -> None:
    [found] = _ranked(
        row("a", "s", "solved", 1.0, start="previous", started="cold: first step"),
        row("b", "s", "solved", 1.0, start="previous", started="cold: the step before was failed"),
        row("c", "s", "wrong", 1.0, start="previous", started="previous"),
        row("d", "s", "timeout", start="previous", started="previous"),
        sheets={"s": {"launches": True}, "t": {"launches": True}},
    )
    assert found.rows[0].warnings == (LAUNCHES, "claims that fail 1", "fell back to cold 1", "timeouts 1")


def test_an_approximate_route_is_marked() -> None:
    [found] = _ranked(row("a", "s@inner8", "solved", 1.0), row("a", "t", "solved", 1.0))
    assert {r.solver: r.warnings for r in found.rows} == {"s@inner8": ("approximate route",), "t": ()}


def test_the_route_of_most_rows_is_named() -> None:
    [found] = _ranked(
        row("a", "s", "solved", 1.0, route="lcp-qp"),
        row("b", "s", "solved", 1.0, route="lcp-mlcp"),
        row("c", "s", "solved", 1.0, route="lcp-qp"),
    )
    assert (found.rows[0].route, found.rows[0].others) == ("lcp-qp", 1)


def test_groups_of_one_node_have_distinct_names() -> None:
    found = _ranked(
        row("a", "s", "solved", 1.0, tolerance=1e-4),
        row("a", "s", "solved", 1.0, tolerance=1e-8, key="other"),
        row("b", "s", "solved", 1.0, node="qp"),
    )
    assert [r.formulation for r in found] == ["lcp, tolerance 1e-08", "lcp, tolerance 0.0001", "qp"]


def test_only_the_first_rows_are_shown() -> None:
    [found] = _ranked(*(row("a", f"s{k:02}", "solved", 1.0 + k) for k in range(LINES + 5)))
    assert len(found.rows) == LINES + 5
    assert [r.solver for r in found.shown] == [f"s{k:02}" for k in range(LINES)]


def test_the_order_of_the_rows_makes_no_difference() -> None:
    rows = [row(p, s, "solved", 1.0) for p in "abc" for s in ("t", "s")]
    assert rankings(rows_of.normalised(table(*rows))) == rankings(rows_of.normalised(pd.DataFrame(rows[::-1])))


def test_stationary_points_come_before_nothing() -> None:
    [found] = _ranked(
        row("a", "convex", "solved", 1.0),
        row("b", "convex", "unsupported"),
        row("a", "general", "solved", 2.0),
        row("b", "general", "stationary", 1.0),
    )
    assert [r.solver for r in found.rows] == ["general", "convex"]
    assert found.sentence == (
        "lcp: a hint from 2 problems: general solves 1 of 2 and finds a stationary point of 1, 2 times the fastest; "
        "convex is 2 times faster on the 1 that both solve."
    )


def test_an_answer_that_a_certificate_refutes_recommends_nobody() -> None:
    """Both pass the measure; a proof puts the only solution elsewhere (an ill-posed program, objectives 31 % apart)."""
    rows = [
        row("a", "quick", "solved", 1.0)
        | {"certainty": "distant", "distance": 0.95, "certificate": "unique: definite"},
        row("a", "boxed", "solved", 2.0) | {"certainty": "refuted", "distance": math.nan, "certificate": "none near"},
        row("a", "other", "solved", 3.0) | {"certainty": "distant", "distance": 0.95, "certificate": "a continuum"},
        row("a", "right", "solved", 4.0) | {"certainty": "proved", "distance": 1e-9, "certificate": "unique: definite"},
    ]
    [found] = _ranked(*rows)
    assert {r.solver: r.solved for r in found.rows} == {"quick": 0, "boxed": 0, "other": 1, "right": 1}
    assert found.rows[0].solver == "other"  # of a continuum another solution is as good
    assert "2 answers that pass are refuted by a certificate and not counted" in found.sentence


def test_a_file_whose_rounding_leaves_it_no_solution_refutes_no_solver() -> None:
    """LIPMWALK4 says 0 ≥ 7e-18: a certificate about its exact numbers refutes every answer."""
    told = {"certainty": "refuted", "distance": math.nan, "certificate": "none near"}
    [found] = _ranked(row("a", "one", "solved", 1.0) | told, row("a", "two", "solved", 2.0) | told)
    assert {r.solver: r.solved for r in found.rows} == {"one": 1, "two": 1}
    assert "refuted" not in found.sentence
