"""Which solver for a problem: planted outcomes whose best advice is known, and the table that is shipped."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_results import row

from cpbench import storage
from cpbench.analysis import table as rows_of
from cpbench.analysis.experience import Case, Experience, experience, family_of, from_text, to_text
from cpbench.analysis.recommendation import WITHIN, WORST, evaluate, rates, recommend
from cpbench.bench.planning.features import features, known
from cpbench.errors import CpbenchError
from cpbench.generators.collection import builtin_folder
from cpbench.solvers.base import solvers

SHIPPED = "recommendation_table.json"


def case(name: str, seconds: Mapping[str, float], *, family: str = "", node: str = "lcp", **facts: float) -> Case:
    return Case(name, node, family or name, f"print of {name}", {"node": node, **facts}, seconds)


def table(*rows: dict[str, Any]) -> pd.DataFrame:
    return rows_of.normalised(pd.DataFrame(list(rows)))


def best(cases: list[Case], node: str = "lcp", may: str = "abcd", **facts: float) -> str:
    return recommend(Experience(tuple(cases)), {"node": node, **facts}, set(may)).advice[0].label


# ------------------------------------------------------------------------------------------- experience


def test_what_counts_as_an_outcome() -> None:
    """A false claim is a failure however fast; who was not started is not there; a problem half run is left out."""
    rows = table(
        row("p-1", "a", "solved", 0.5),
        row("p-1", "b", "wrong", 0.1),
        row("p-1", "c", "unsupported"),
        row("p-1", "d", "unavailable"),
        row("p-1", "e", "timeout", 10.0),
        row("p-2", "a", "solved", 0.5),
        row("p-2", "b", "not_run"),
        row("p-3", "a", "failed", 0.5),
        row("p-4", "a", "solved", 0.5, origin="another machine"),
    )
    found = experience(rows, {"f-p-1": {"node": "lcp", "unknowns": 7.0}})
    assert [c.problem for c in found.cases] == ["p-1"]
    assert found.cases[0].outcomes == {"a": 0.5, "b": math.inf, "e": math.inf}
    assert found.cases[0].features == {"node": "lcp", "unknowns": 7.0}
    assert (found.unsolved, found.unfinished) == (1, 1)
    assert found.labels == ("a", "b", "e")
    assert found.ratios.tolist() == [[1.0, math.inf, math.inf]]


def test_times_of_other_settings_are_not_compared() -> None:
    rows = table(
        row("p-1", "a", "solved", 4.0, host="slow"),
        row("p-1", "b", "solved", 8.0, host="slow"),
        row("p-1", "b", "solved", 1.0, host="fast", key="k1"),
        row("p-1", "a", "solved", 16.0, tolerance=1e-9, host="slow", key="k2"),
    )
    found = experience(rows, {})
    assert sorted(tuple(sorted(c.outcomes.items())) for c in found.cases) == [
        (("a", 4.0), ("b", 8.0)),
        (("a", 16.0),),
        (("b", 1.0),),
    ]
    told = recommend(found, {"node": "lcp", "n": 3.0}, {"a", "b"})
    assert told.measured == 1, "it is one problem"


def test_warm_and_inexact_rows_count_when_they_are_asked_for() -> None:
    rows = table(
        row("p-1", "a", "solved", 1.0),
        row("p-1", "a@inner8", "solved", 0.1),
        row("p-1", "a", "solved", 0.2, start="previous", started="previous", key="k1"),
        row("p-1", "b", "solved", 0.3, start="previous", started="cold: no answer before", key="k2"),
    )
    assert experience(rows, {}).labels == ("a",)
    both = experience(rows, {}, inexact=True)
    assert both.labels == ("a", "a@inner8")
    assert both.requests == {"a@inner8": "inner8"}
    warm = experience(rows, {}, warm=True)
    assert [c.outcomes for c in warm.cases] == [{"a": 0.2}]


@pytest.mark.parametrize(
    ("family", "problem", "found"),
    [
        ("chains", "x", "chains"),
        ("", "mj_soup60-nc140", "mj"),
        ("", "LISWET1.mat", "LISWET"),
        ("", "7", "7"),
        ("", "", ""),
    ],
)
def test_families(family: str, problem: str, found: str) -> None:
    assert family_of(family, problem) == found


def test_a_table_comes_back_from_its_text() -> None:
    cases = (
        case("q", {"b": 1.23456e-3, "a": math.inf}, n=3.0, spread=1234.5),
        case("p", {"a": 1.0, "hidden": 0.5}, n=2.0),
        case("r", {"hidden": 0.5}, n=2.0),
    )
    text = to_text(Experience(cases, unsolved=2), without=["hidden"], about="made here")
    again = from_text(text, "t.json")
    assert [c.problem for c in again.cases] == ["p", "q"], "sorted; nobody else solved r"
    assert again.cases[1].outcomes == {"a": math.inf, "b": 1.23e-3}
    assert again.cases[1].features == {"node": "lcp", "n": 3.0, "spread": 1230.0}
    assert again.unsolved == 2
    assert to_text(again, about="made here") == text
    assert "hidden" not in text


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "no table"),
        ("[]", "no table"),
        ("[" * 100_000, "no table"),
        ('{"version": 99}', "version 99"),
        ('{"version": 1, "cases": [{}], "unsolved": 0}', "no table"),
        ('{"version": 1, "cases": [{"node": "lcp", "family": "", "problem": "", "fingerprint": "", '
         '"features": {"n": "three"}, "seconds": {}}], "unsolved": 0}', "no table"),
    ],
)  # fmt: skip
def test_what_is_no_table(text: str, word: str) -> None:
    with pytest.raises(CpbenchError, match=word) as told:
        from_text(text, "t.json")
    assert "\n" not in str(told.value)
    assert "--make" in str(told.value)


# --------------------------------------------------------------------------------------- recommendation


def test_the_crossing_of_two_solvers_is_found() -> None:
    """a takes n² µs and b 100 n µs: a is best below n = 100 and b above."""
    sizes = [5, 9, 17, 33, 65, 180, 350, 700, 1400]
    cases = [case(f"p{n}", {"a": n**2 * 1e-6, "b": n * 1e-4}, unknowns=n) for n in sizes]
    assert [best(cases, unknowns=n) for n in (7, 20, 50, 250, 1000)] == ["a", "a", "a", "b", "b"]


def test_failures_cost_more_than_slowness() -> None:
    cases = [case(f"p{i}", {"a": 0.1, "b": math.inf if i % 2 else 0.01}, unknowns=9) for i in range(8)]
    assert best(cases, unknowns=9) == "a"


def test_of_equals_the_one_that_solved_most_like_it_is_taken() -> None:
    """Both are best on average over the node; b failed once, though, on a problem just like this one."""
    cases = [case(f"p{i}", {"a": 1.0, "b": 1.0}, unknowns=9) for i in range(200)]
    cases.append(case("q", {"a": 1.0, "b": math.inf}, unknowns=9))
    found = recommend(Experience(tuple(cases)), {"node": "lcp", "unknowns": 9.0}, {"a", "b"})
    assert [(x.label, x.similar, x.solved) for x in found.advice] == [("a", 201, 201), ("b", 201, 200)]


def test_one_measurement_says_little() -> None:
    """c was measured once, and was fastest; a was best within 1.4 of it on ten problems."""
    cases = [case(f"p{i}", {"a": 1.0, "b": 1.4}, unknowns=9) for i in range(10)]
    cases.append(case("one", {"a": 1.1, "b": 1.4, "c": 1.0}, unknowns=9))
    assert best(cases, unknowns=9) == "a"


def test_another_formulation_helps_as_far_as_the_same_solvers_reach_it() -> None:
    """No avi was measured; the solvers that take this one take the lcp problems, not the fc ones."""
    cases = [case(f"l{i}", {"a": 1.0, "b": 3.0}, unknowns=9) for i in range(3)]
    cases += [case(f"f{i}", {"b": 0.1, "c": 0.1, "d": 0.1}, node="fc", unknowns=9) for i in range(3)]
    found = recommend(Experience(tuple(cases)), {"node": "avi", "unknowns": 9.0}, {"a", "b"})
    assert found.advice[0].label == "a"
    assert (found.measured, found.similar, found.known, found.distance) == (0, 0, False, math.inf)


def test_the_own_formulation_comes_first() -> None:
    cases = [case(f"l{i}", {"a": 1.0, "b": 8.0}, unknowns=9) for i in range(50)]
    cases += [case(f"q{i}", {"a": 8.0, "b": 1.0}, node="qp", unknowns=11) for i in range(3)]
    assert best(cases, node="qp", unknowns=9) == "b"


def test_what_is_far_away_is_not_alike() -> None:
    cases = [case(f"p{n}", {"a": 1.0}, unknowns=n, density=0.5) for n in (10, 20, 30)]
    near = recommend(Experience(tuple(cases)), {"node": "lcp", "unknowns": 20.0, "density": 0.5}, {"a"})
    far = recommend(Experience(tuple(cases)), {"node": "lcp", "unknowns": 1e6, "density": 1e-5}, {"a"})
    assert near.known
    assert (near.nearest, near.distance) == ("p20", 0.0)
    assert not far.known
    assert (far.measured, far.advice[0].similar) == (3, 0)


def test_only_what_takes_the_problem_is_ranked() -> None:
    cases = [case("p", {"a": 1.0, "b": 2.0}, unknowns=9)]
    assert best(cases, may="b", unknowns=9) == "b"
    assert recommend(Experience(tuple(cases)), {"node": "lcp"}, set()).advice == ()


@given(st.lists(st.tuples(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3), st.integers(1, 1000)), min_size=1, max_size=8))
@settings(max_examples=40, deadline=None)
def test_the_order_of_cases_and_the_unit_of_time_do_not_matter(data: list[tuple[float, float, int]]) -> None:
    cases = [case(f"p{i}", {"a": a, "b": b}, unknowns=n) for i, (a, b, n) in enumerate(data)]
    slower = [
        case(c.problem, {k: 8 * v for k, v in c.outcomes.items()}, unknowns=n)
        for c, (_, _, n) in zip(cases, data, strict=True)
    ]
    facts = {"node": "lcp", "unknowns": 30.0}
    found, other, turned = (
        recommend(Experience(tuple(x)), facts, {"a", "b"}) for x in (cases, slower, list(reversed(cases)))
    )
    for one in (other, turned):
        assert [x.label for x in one.advice] == [x.label for x in found.advice]
        np.testing.assert_allclose([x.loss for x in one.advice], [x.loss for x in found.advice], rtol=1e-9)
    assert all(0.0 <= x.loss <= WORST for x in found.advice)


# ------------------------------------------------------------------------------------------- evaluation


def test_a_family_does_not_advise_itself() -> None:
    """a is best in family u only, b in the two others: b is recommended to all, and fails u."""
    cases = [case(f"u{i}", {"a": 1.0, "b": math.inf}, family="u", unknowns=9) for i in range(9)]
    cases += [case(f"v{i}", {"a": 3.0, "b": 1.0}, family="v", unknowns=9) for i in range(5)]
    cases += [case(f"w{i}", {"a": 3.0, "b": 1.0}, family="w", unknowns=9) for i in range(5)]
    seen = Experience(tuple(cases))
    found = evaluate(seen)
    assert set(found.loc[found["family"] == "u", "label"]) == {"b"}
    assert np.isinf(found.loc[found["family"] == "u", "ratio"]).all()
    lcp, every = rates(seen, found).to_dict("records")
    assert (lcp["problems"], lcp["families"], lcp["single"], lcp["single_solved"]) == (19, 3, "b", 10)
    assert every["node"] == "all"
    assert every["solved"] == lcp["solved"] == int(np.isfinite(found["ratio"]).sum())


def test_no_more_cases_are_tried_than_asked() -> None:
    seen = Experience(tuple(case(f"p{i}", {"a": 1.0}, unknowns=9) for i in range(10)))
    assert evaluate(seen, "lcp", 4)["problem"].tolist() == ["p0", "p2", "p5", "p7"]
    assert len(evaluate(seen, "qp", 4)) == 0


def test_the_same_problem_in_another_family_does_not_advise_either() -> None:
    twin = case("p", {"a": 1.0, "b": 9.0}, family="u", unknowns=9)
    copied = Case("copy", "lcp", "v", twin.fingerprint, twin.features, twin.outcomes)
    other = case("q", {"a": 9.0, "b": 1.0}, family="w", unknowns=500)
    found = evaluate(Experience((twin, copied, other)))
    assert found["label"].tolist() == ["b", "b", "a"]


def test_where_nothing_measured_takes_the_problem_something_else_is_tried() -> None:
    found = evaluate(Experience((case("p", {"a": 1.0}, family="u"), case("q", {"b": 1.0}, family="v"))))
    assert found["label"].tolist() == ["a", "b"]
    assert found["ratio"].tolist() == [1.0, 1.0]
    assert rates(Experience(()), evaluate(Experience(()))).to_dict("records")[0]["problems"] == 0


def test_what_was_never_measured_comes_last() -> None:
    seen = Experience((case("p", {"b": math.inf, "c": 1.0}, unknowns=9),))
    ranked = recommend(seen, {"node": "lcp", "unknowns": 9.0}, {"a", "b", "c", "z"}).advice
    assert [(one.label, one.measured) for one in ranked] == [("c", 1), ("b", 1), ("a", 0), ("z", 0)]


# --------------------------------------------------------------------------------- the table that is shipped


@pytest.fixture(scope="module")
def shipped() -> Experience:
    return from_text(files("cpbench.analysis").joinpath(SHIPPED).read_text(encoding="utf-8"), SHIPPED)


def test_the_shipped_table_is_of_the_built_in_problems(shipped: Experience) -> None:
    text = files("cpbench.analysis").joinpath(SHIPPED).read_text(encoding="utf-8")
    assert len(text) < 300_000
    assert to_text(shipped, about=json.loads(text)["about"]) == text
    problems = {p.fingerprint: p for p in map(storage.load, storage.problem_files([builtin_folder()]))}
    assert {c.fingerprint for c in shipped.cases} <= problems.keys()
    assert len(shipped.cases) + shipped.unsolved == len(problems)
    names = known()
    for one in shipped.cases:
        assert set(one.features) <= names.keys()
        measured = features(problems[one.fingerprint])
        assert one.features["unknowns"] == measured["unknowns"]
    for label in shipped.labels:
        assert label.partition("[")[0] in solvers, label
        assert not solvers.get(label.partition("[")[0]).spec.publishing, label


def test_its_advice_is_good_for_families_that_were_left_out(shipped: Experience) -> None:
    every = rates(shipped, evaluate(shipped)).to_dict("records")[-1]
    assert every["solved"] >= 0.8 * every["problems"]
    assert every["within"] >= 0.8 * every["problems"]
    assert WITHIN == 2.0
