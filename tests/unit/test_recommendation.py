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
from cpbench.advice.recommendation import SHIPPED as KNOBS
from cpbench.advice.recommendation import WITHIN, recommend
from cpbench.advice.validation import chosen, dealt, evaluate, rates
from cpbench.analysis import table as rows_of
from cpbench.analysis.origins import family_of, origins
from cpbench.analysis.training_cases import (
    SHIPPED,
    TrainingCase,
    TrainingCases,
    collect_cases,
    from_text,
    shipped_cases,
    to_text,
)
from cpbench.bench.planning.features import features, known
from cpbench.errors import CpbenchError
from cpbench.generators.collection import builtin_folder
from cpbench.solvers.base import solvers


def spelled(name: str) -> str:
    """A family of a problem's own: a name in letters that no other begins with."""
    return "".join(chr(ord("a") + ord(letter) % 26) for letter in name)[::-1]


def case(
    name: str, seconds: Mapping[str, float], *, family: str = "", node: str = "lcp", **facts: float
) -> TrainingCase:
    return TrainingCase(name, node, family or spelled(name), f"print of {name}", {"node": node, **facts}, seconds)


def table(*rows: dict[str, Any]) -> pd.DataFrame:
    return rows_of.normalised(pd.DataFrame(list(rows)))


def best(cases: list[TrainingCase], node: str = "lcp", may: str = "abcd", **facts: float) -> str:
    return recommend(TrainingCases(tuple(cases)), {"node": node, **facts}, set(may)).advice[0].label


# ------------------------------------------------------------------------------------------- training cases


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
    found = collect_cases(rows, {"f-p-1": {"node": "lcp", "unknowns": 7.0}})
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
    found = collect_cases(rows, {})
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
    assert collect_cases(rows, {}).labels == ("a",)
    both = collect_cases(rows, {}, inexact=True)
    assert both.labels == ("a", "a@inner8")
    assert both.requests == {"a@inner8": "inner8"}
    warm = collect_cases(rows, {}, warm=True)
    assert [c.outcomes for c in warm.cases] == [{"a": 0.2}]


@pytest.mark.parametrize(
    ("family", "problem", "found"),
    [
        ("chains", "x", "chains"),
        ("", "mj_soup60-nc140", "mj"),
        ("", "LISWET1.mat", "LISWET"),
        ("", "7", "7"),
        ("", "", ""),
        ("", "Chute-ndof-768-nc-4-3.hdf5", "Chute"),
        ("", "GRFC3D_Chute-ndof-768-nc-4-3.dat", "Chute"),
        ("", "lcp-17.h5", "lcp"),
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
    text = to_text(TrainingCases(cases, unsolved=2), without=["hidden"], about="made here")
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
    found = recommend(TrainingCases(tuple(cases)), {"node": "lcp", "unknowns": 9.0}, {"a", "b"})
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
    found = recommend(TrainingCases(tuple(cases)), {"node": "avi", "unknowns": 9.0}, {"a", "b"})
    assert found.advice[0].label == "a"
    assert (found.measured, found.similar, found.known, found.distance) == (0, 0, False, math.inf)


def test_the_own_formulation_comes_first() -> None:
    cases = [case(f"l{i}", {"a": 1.0, "b": 8.0}, unknowns=9) for i in range(50)]
    cases += [case(f"q{i}", {"a": 8.0, "b": 1.0}, node="qp", unknowns=11) for i in range(3)]
    assert best(cases, node="qp", unknowns=9) == "b"


def test_what_is_far_away_is_not_alike() -> None:
    cases = [case(f"p{n}", {"a": 1.0}, unknowns=n, density=0.5) for n in (10, 20, 30)]
    near = recommend(TrainingCases(tuple(cases)), {"node": "lcp", "unknowns": 20.0, "density": 0.5}, {"a"})
    far = recommend(TrainingCases(tuple(cases)), {"node": "lcp", "unknowns": 1e6, "density": 1e-5}, {"a"})
    assert near.known
    assert (near.nearest, near.distance) == ("p20", 0.0)
    assert not far.known
    assert (far.measured, far.advice[0].similar) == (3, 0)


def test_only_what_takes_the_problem_is_ranked() -> None:
    cases = [case("p", {"a": 1.0, "b": 2.0}, unknowns=9)]
    assert best(cases, may="b", unknowns=9) == "b"
    assert recommend(TrainingCases(tuple(cases)), {"node": "lcp"}, set()).advice == ()


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
        recommend(TrainingCases(tuple(x)), facts, {"a", "b"}) for x in (cases, slower, list(reversed(cases)))
    )
    for one in (other, turned):
        assert [x.label for x in one.advice] == [x.label for x in found.advice]
        np.testing.assert_allclose([x.loss for x in one.advice], [x.loss for x in found.advice], rtol=1e-9)
    assert all(0.0 <= x.loss <= KNOBS.worst for x in found.advice)


# ------------------------------------------------------------------------------------------- evaluation


@pytest.mark.parametrize(
    ("names", "apart"),
    [
        (["hock-schittkowski-bounds", "hock-schittkowski-linear", "hock-schittkowski-nonlinear"], 1),
        (["contact-planted-2d", "contact-planted-3d", "contact-global", "contact-joints"], 1),
        (["lcp-planted", "lcp-classics"], 1),
        (["harker-pang", "harker-pang-sets"], 1),
        (["TORSION", "TORSIONA", "torsion"], 1),
        (["OBSTCLAE", "OBSTCLAL", "OBSTCLBM"], 1),
        (["DUAL", "DUALC", "PRIMAL", "PRIMALC"], 2),
        (["QPCBOEI", "QPCBLEND", "QPCSTAIR"], 3),
        (["walras", "rolling", "torsion", "nash-cournot"], 4),
        (["1", "2"], 2),
        ([], 0),
    ],
)
def test_families_of_one_collection_are_one_origin(names: list[str], apart: int) -> None:
    assert len(set(origins(names, [str(i) for i in range(len(names))]))) == apart


def test_a_problem_in_two_families_makes_them_one_origin() -> None:
    assert len(set(origins(["chains", "walls", "walls", "stacks"], ["1", "1", "2", "3"]))) == 2


@given(st.lists(st.text("abcd-1", max_size=9), max_size=9), st.randoms(use_true_random=False))
@settings(max_examples=60, deadline=None)
def test_what_is_of_one_origin_does_not_depend_on_the_order(names: list[str], draw: Any) -> None:
    prints = [str(i) for i in range(len(names))]
    order = draw.sample(range(len(names)), len(names))
    found = origins(names, prints)
    assert [found[i] for i in order] == list(origins([names[i] for i in order], prints))


def test_an_origin_does_not_advise_itself() -> None:
    """a is best in the families of u only, b in the two others: b is recommended to all, and fails u."""
    cases = [case(f"u{i}", {"a": 1.0, "b": math.inf}, family=f"umbra-{i % 3}", unknowns=9) for i in range(9)]
    cases += [case(f"v{i}", {"a": 3.0, "b": 1.0}, family="vault", unknowns=9) for i in range(5)]
    cases += [case(f"w{i}", {"a": 3.0, "b": 1.0}, family="walls", unknowns=9) for i in range(5)]
    seen = TrainingCases(tuple(cases))
    found = evaluate(seen)
    umbra = found["origin"] == "umbra"
    assert umbra.sum() == 9
    assert set(found.loc[umbra, "label"]) == set(found.loc[umbra, "plain"]) == {"b"}
    assert np.isinf(found.loc[umbra, "ratio"]).all()
    lcp, every = rates(seen, found).to_dict("records")
    assert (lcp["problems"], lcp["origins"], lcp["single"], lcp["single_solved"]) == (19, 3, "b", 10)
    assert every["node"] == "all"
    assert every["solved"] == lcp["solved"] == int(np.isfinite(found["ratio"]).sum())


@pytest.mark.nightly
def test_no_choice_of_knobs_sees_what_they_advise() -> None:
    """Changing all outcomes of a part changes neither its knobs nor what it is advised."""
    rng = np.random.default_rng(3)
    names = ["ash", "birch", "cedar", "fir", "larch", "maple", "oak", "pine", "rowan", "yew"]

    def outcomes(shift: float) -> dict[str, float]:
        return {label: float(rng.lognormal(shift * k)) for k, label in enumerate("abc")}

    seen = [case(f"p{i}", outcomes(0.5), family=names[i % 10], unknowns=float(2 + i)) for i in range(60)]
    known = TrainingCases(tuple(seen))
    part = dealt(known)
    held = part == part[0]
    other = TrainingCases(
        tuple(
            TrainingCase(c.problem, c.node, c.family, c.fingerprint, c.features, outcomes(-3.0)) if own else c
            for c, own in zip(seen, held, strict=True)
        )
    )
    assert chosen(known, part)[part[0]] == chosen(other, part)[part[0]]
    one, two = evaluate(known), evaluate(other)
    assert one.loc[held, "origin"].nunique() == 2
    own = one["origin"] == one["origin"][0]
    assert own.sum() == 6
    alone = known.origins == known.origins[0]
    assert set(part[alone]) == {part[0]}
    third = TrainingCases(
        tuple(
            TrainingCase(c.problem, c.node, c.family, c.fingerprint, c.features, outcomes(-3.0)) if mine else c
            for c, mine in zip(seen, alone, strict=True)
        )
    )
    assert one.loc[own, ["label", "plain"]].equals(evaluate(third).loc[own, ["label", "plain"]])
    assert not one["ratio"].equals(two["ratio"])


def test_the_knobs_that_serve_the_others_arechosen() -> None:
    """A narrow kernel sees that small problems want a and large ones b; a wide one takes the majority's."""
    names = ["ash", "birch", "cedar", "fir", "larch", "maple"]
    cases = []
    for i, name in enumerate(names):
        small = {"a": 1.0, "b": 5.0}
        large = {"a": 5.0, "b": 1.0}
        cases += [case(f"s{i}{k}", small, family=name, unknowns=10.0 + k, density=0.5) for k in range(5)]
        cases += [case(f"l{i}{k}", large, family=name, unknowns=1e4 + k, density=0.5) for k in range(2)]
    found = evaluate(TrainingCases(tuple(cases)))
    assert (found["ratio"] == 1.0).all()
    assert (found["plain"] == "a").all()
    assert (found["plain_ratio"] == 5.0).sum() == 12


@pytest.mark.nightly
def test_the_advice_is_that_of_recommend() -> None:
    """The choices of many cases at once are those that `recommend` makes for one, on the shipped table."""
    known = shipped_cases()
    part = dealt(known)
    knobs = chosen(known, part)
    asked = [i for i, case in enumerate(known.cases) if case.node == "ncp"]
    told = [
        recommend(
            known,
            known.cases[i].features,
            known.cases[i].outcomes.keys(),
            known.origins != known.origins[i],
            knobs[part[i]],
        )
        for i in asked
    ]
    assert [one.advice[0].label for one in told] == evaluate(known, "ncp")["label"].tolist()


def test_no_more_cases_are_tried_than_asked() -> None:
    seen = TrainingCases(tuple(case(f"p{i}", {"a": 1.0}, unknowns=9) for i in range(10)))
    assert evaluate(seen, "lcp", 4)["problem"].tolist() == ["p0", "p2", "p5", "p7"]
    assert len(evaluate(seen, "qp", 4)) == 0


def test_the_same_problem_in_another_family_does_not_advise_either() -> None:
    twin = case("p", {"a": 1.0, "b": 9.0}, family="umbra", unknowns=9)
    copied = TrainingCase("copy", "lcp", "vault", twin.fingerprint, twin.features, twin.outcomes)
    other = case("q", {"a": 9.0, "b": 1.0}, family="walls", unknowns=500)
    found = evaluate(TrainingCases((twin, copied, other)))
    assert found["label"].tolist() == ["b", "b", "a"]


def test_where_nothing_measured_takes_the_problem_something_else_is_tried() -> None:
    found = evaluate(TrainingCases((case("p", {"a": 1.0}, family="umbra"), case("q", {"b": 1.0}, family="vault"))))
    assert found["label"].tolist() == ["a", "b"]
    assert found["ratio"].tolist() == [1.0, 1.0]
    assert rates(TrainingCases(()), evaluate(TrainingCases(()))).to_dict("records")[0]["problems"] == 0


def test_what_was_never_measured_comes_last() -> None:
    seen = TrainingCases((case("p", {"b": math.inf, "c": 1.0}, unknowns=9),))
    ranked = recommend(seen, {"node": "lcp", "unknowns": 9.0}, {"a", "b", "c", "z"}).advice
    assert [(one.label, one.measured) for one in ranked] == [("c", 1), ("b", 1), ("a", 0), ("z", 0)]


# --------------------------------------------------------------------------------- the table that is shipped


@pytest.fixture(scope="module")
def shipped() -> TrainingCases:
    return shipped_cases()


def test_the_shipped_table_is_of_the_built_in_problems(shipped: TrainingCases) -> None:
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


@pytest.mark.nightly
def test_what_the_shipped_advice_is_worth(shipped: TrainingCases) -> None:
    """Origins left out, knobs chosen without them: it beats what is chosen beforehand, and not what is chosen after."""
    found = evaluate(shipped)
    assert found.loc[found["node"] == "nlp", "origin"].nunique() == 1, (
        "Hock and Schittkowski's tests are one collection"
    )
    every = rates(shipped, found).to_dict("records")[-1]
    assert every["problems"] == len(shipped.cases)
    assert every["solved"] >= 0.95 * every["problems"]
    assert every["plain_within"] < every["within"] < every["single_within"], "the README says so"
    assert every["auto_within"] < every["within"]
    assert WITHIN == 2.0
