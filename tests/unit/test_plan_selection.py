"""Which problems a plan is about: globs, conditions, draws and shards."""

from __future__ import annotations

import random
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from synthetic_results import pair as planned

from cpbench import storage
from cpbench.bench.messages import Surveyed
from cpbench.bench.planning import features, grids, plan, quantities, selection
from cpbench.bench.planning.plan import Pair
from cpbench.bench.planning.run_plan import ProblemSet
from cpbench.errors import CpbenchError
from cpbench.formulations import LCP, FrictionContact, GlobalFrictionContact, Sequence
from cpbench.formulations.base import formulations
from cpbench.generators.collection import builtin_folder
from cpbench.solvers.base import solvers


def survey(
    name: str, *, family: str = "", node: str = "lcp", sequence: str = "", step: int = 0, **facts: float
) -> Surveyed:
    return Surveyed(
        address=f"folder/{name}.h5",
        format=None,
        problem=name,
        family=family,
        node=node,
        fingerprint=f"{name}-mathematics",
        sizes={},
        sequence=sequence,
        step=step,
        features={"node": node, "family": family, "name": name, **facts},
        nodes={},
    )


def names(part: ProblemSet, surveys: list[Surveyed]) -> list[str]:
    return [s.problem for s in selection.select(part, surveys)]


# ----------------------------------------------------------------------------------------------- places


@pytest.fixture
def scenes(tmp_path: Path) -> Path:
    for name in ("box-1", "box-2", "chain"):
        storage.save(LCP(M=np.eye(2), q=[-1.0, -2.0], name=name), tmp_path / f"{name}.h5")
    pack = {n: LCP(M=np.eye(2), q=[-1.0, -3.0], name=n) for n in ("murty-4", "murty-8", "cottle")}
    storage.save_pack(pack, tmp_path / "pack.h5")
    (tmp_path / "notes.txt").write_text("no problem")
    return tmp_path


@pytest.mark.parametrize(
    ("texts", "found"),
    [
        (["box-*.h5"], ["box-1.h5", "box-2.h5"]),
        (["box-[2].h5", "box-2.h5"], ["box-2.h5"]),
        (["pack.h5"], ["pack.h5::cottle", "pack.h5::murty-4", "pack.h5::murty-8"]),
        (["pack.h5::murty-*"], ["pack.h5::murty-4", "pack.h5::murty-8"]),
        (["*.h5::*-8"], ["pack.h5::murty-8"]),
        (["c*.h5::*"], ["chain.h5"]),
        (["**/*a*.h5"], ["chain.h5", "pack.h5::cottle", "pack.h5::murty-4", "pack.h5::murty-8"]),
    ],
)
def test_places(scenes: Path, texts: list[str], found: list[str]) -> None:
    assert selection.addresses([f"{scenes}/{text}" for text in texts], builtin_folder) == [
        f"{scenes}/{name}" for name in found
    ]


def test_a_file_whose_name_is_a_glob_is_that_file(scenes: Path) -> None:
    (scenes / "box-*.h5").write_bytes((scenes / "chain.h5").read_bytes())
    assert selection.addresses([f"{scenes}/box-*.h5"], builtin_folder) == [f"{scenes}/box-*.h5"]


def test_builtin_is_a_place(scenes: Path, monkeypatch) -> None:
    monkeypatch.chdir(scenes)
    folder = builtin_folder()
    everything = storage.problem_files([folder])
    assert selection.addresses(["builtin"], builtin_folder) == everything
    assert selection.addresses(["builtin/lcp"], builtin_folder) == storage.problem_files([folder / "lcp"])
    some = selection.addresses(["builtin/*/lcp-classics.h5::murty*"], builtin_folder)
    assert some
    assert set(some) < set(everything)


@pytest.mark.parametrize("text", ["*.mat", "box-9*", "pack.h5::zzz*", "chain.h5::a*", "empty"])
def test_a_pattern_without_matches_is_refused(scenes: Path, text: str) -> None:
    (scenes / "empty").mkdir()
    with pytest.raises(CpbenchError, match=r"nothing matches|no problem file"):
        selection.addresses([f"{scenes}/{text}"], builtin_folder)


# ------------------------------------------------------------------------------------------------ facts


def test_facts_of_problems() -> None:
    sparse = np.diag([1.0, 2, 3, 4, 5, 6])
    local = FrictionContact(W=sparse, q=np.ones(6), mu=[0.5, 0.3], dimension=3, name="two")
    facts = features.features(local)
    assert facts | {"nc": 2.0, "m": 6.0, "dimension": 3.0, "nnz": 6.0, "entries": 36.0, "unknowns": 6.0} == facts
    assert facts["density"] == pytest.approx(1 / 6)
    assert facts | {"mu_min": 0.3, "mu_median": 0.4, "mu_max": 0.5} == facts
    assert "ndof" not in facts, "a local problem does not know it"
    scene = Sequence(name="pile", step=4, time=0.4, dt=0.1)
    full = GlobalFrictionContact(
        M=np.eye(4), H=np.eye(4)[:, :3], f=np.ones(4), w=np.ones(3), mu=[0.5], dimension=3, sequence=scene
    )
    facts = features.features(full)
    assert facts | {"ndof": 4.0, "nc": 1.0, "sequence": "pile", "step": 4.0} == facts


@pytest.mark.nightly
def test_every_fact_of_every_builtin_problem_is_known_with_its_type() -> None:
    known = features.known()
    nodes = set()
    for address in storage.problem_files([builtin_folder()]):
        problem = storage.load(address)
        nodes.add(problem.node)
        for name, value in features.features(problem).items():
            assert type(value) is known[name], name
    assert nodes == set(formulations.names())


def test_conditions_choose() -> None:
    surveys = [
        survey("a", family="chains", node="gfc", nc=120.0, ndof=300.0),
        survey("b", family="chains", node="gfc", nc=10.0, ndof=300.0),
        survey("c", family="classics", node="lcp", n=8.0),
    ]
    assert names(ProblemSet(where="nc>100 and 3*nc/ndof>1"), surveys) == ["a"]
    assert names(ProblemSet(where="not nc > 100"), surveys) == ["b"], "c has no nc: nothing is known of it"
    assert names(ProblemSet(where="node == 'lcp' or nc > 100"), surveys) == ["a", "c"]
    assert names(ProblemSet(where="family == 'chains'"), surveys) == ["a", "b"]
    assert names(ProblemSet(where="name in ['b', 'c'] and n > 1"), surveys) == ["c"]
    assert names(ProblemSet(), surveys) == ["a", "b", "c"]
    assert names(ProblemSet(where="n > 1"), []) == []


# ----------------------------------------------------------------------------------------------- shards


def pair(problem: str, solver: str, **given: Any) -> Pair:
    return planned(0, solver, address=f"{problem}.h5", problem=problem, fingerprint=problem, **given)


@settings(max_examples=60, deadline=None)
@given(
    st.sets(st.tuples(st.text("abcdefgh", min_size=1, max_size=4), st.sampled_from(["lemke", "pgs"])), max_size=40),
    st.integers(1, 7),
    st.randoms(use_true_random=False),
)
def test_shards_are_disjoint_and_complete_in_any_order(keys, parts: int, draw: random.Random) -> None:
    pairs = [pair(problem, solver) for problem, solver in sorted(keys)]
    shuffled = list(pairs)
    draw.shuffle(shuffled)
    shards = [{p.key for p in selection.shard(shuffled, i, parts)} for i in range(1, parts + 1)]
    assert sum(map(len, shards)) == len(pairs)
    assert set().union(*shards) == {p.key for p in pairs}
    of = {p.key: p for p in pairs}
    for a in range(parts):
        problems = {of[key].problem for key in shards[a]}
        assert not any(of[key].problem in problems for b in range(parts) if b != a for key in shards[b])


def test_shards_hold_about_as_much_and_keep_sequences_whole() -> None:
    pairs = [pair(f"p{i}", solver) for i in range(1000) for solver in ("lemke", "pgs")]
    sizes = [len(selection.shard(pairs, i, 4)) for i in range(1, 5)]
    assert sum(sizes) == 2000
    assert max(sizes) < 1.2 * min(sizes)
    scene = [pair(f"s{i}", "pgs", sequence="pile", step=i, start="previous") for i in range(20)]
    assert sorted(len(selection.shard(scene, i, 4)) for i in range(1, 5)) == [0, 0, 0, 20]
    cold = [pair(f"s{i}", "pgs", sequence="pile", step=i) for i in range(20)]
    assert max(len(selection.shard(cold, i, 4)) for i in range(1, 5)) < 20


def labels(*texts: str) -> list[str]:
    return [entry.label for entry in grids.entries(texts)]


@pytest.mark.needs("cpbench_solvers")
def test_a_grid_has_every_combination() -> None:
    found = grids.grid("nsgs[omega=0.8:1.4:0.2, shuffle=true|false]")
    assert [e.options["omega"] for e in found] == [0.8, 0.8, 1.0, 1.0, 1.2, 1.2, 1.4, 1.4], "decimal, end included"
    assert [e.options["shuffle"] for e in found] == [True, False] * 4
    assert len({e.label for e in found}) == 8


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("0.1:0.7:0.1", [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]),  # 0.1 + 6 * 0.1 > 0.7 in binary
        ("1:2:0.3", [1.0, 1.3, 1.6, 1.9]),
        ("0:1:0.333333333333", [0.0, 0.333333333333, 0.666666666666, 0.999999999999]),
        ("0:1:0.3333333334", [0.0, 0.3333333334, 0.6666666668, 1.0000000002]),  # within rounding of its end
        ("1.5:1:-0.25", [1.5, 1.25, 1.0]),
        ("1:1:1", [1.0]),
        ("1.9|1:1.2:0.1", [1.9, 1.0, 1.1, 1.2]),
    ],
)
def test_ranges_include_their_end(text: str, values: list[float]) -> None:
    assert [e.options["omega"] for e in grids.grid(f"psor[omega={text}]")] == values


@pytest.mark.needs("cpbench_solvers")
def test_values_have_the_type_of_the_option() -> None:
    assert [e.options["max_iterations"] for e in grids.grid("nsgs[max_iterations=1e2:3e2:100]")] == [100, 200, 300]
    assert all(type(e.options["max_iterations"]) is int for e in grids.grid("nsgs[max_iterations=1:3:1]"))


@pytest.mark.needs("cpbench_solvers")
def test_globs_choose_among_the_names() -> None:
    assert labels("newton-m*") == ["newton-min", "newton-min-micp", "newton-min-mlcp"]
    asked = [f"{name}[max_iterations=9]" for name in ("nsgs", "nsgs-gfc", "nsgs-rfc")]
    assert labels("nsgs*[max_iterations=9]") == asked
    assert labels("lemke", "l?mke", "lemke") == ["lemke"], "each once"


def test_a_run_that_names_none_takes_those_that_run_by_default() -> None:
    chosen = [solver.spec.name for solver in solvers if solver.spec.by_default]
    assert [entry.label for entry in grids.by_default()] == chosen
    assert labels("all") == labels("*") == solvers.names()


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("nsga", "did you mean nsgs"),
        ("neuton-*", "unknown solver 'neuton-*'"),
        ("nsgs[omga=1|2]", "omega"),
        ("nsgs*[omega=1", "not closed"),
        ("nsgs[omega]", "'omega' is not an option"),
        ("nsgs[omega=]", "is not an option"),
        ("nsgs[omega=1,omega=2]", "twice"),
        ("nsgs[omega=fast|slow]", "float"),
        ("nsgs[shuffle=true|perhaps]", "bool"),
        ("nsgs[omega=1:2]", "no range"),
        ("nsgs[omega=1:2:0]", "no range"),
        ("nsgs[omega=1:x:1]", "no range"),
        ("nsgs[omega=1:2:-1]", "has no end"),
        ("nsgs[omega=1:inf:1]", "has no end"),
        ("nsgs[omega=0:1:1e-9]", "1e+9 numbers"),
        ("nsgs[omega=0:1e999999:1e-999999]", "no range"),
        ("nsgs[omega=0:1:0.001,stall_window=1:100:1]", "100100 entries"),
        ("nsgs[max_iterations=1:2:0.5]", "int"),
    ],
)
def test_an_unknown_solver_is_refused_in_one_line(text: str, word: str) -> None:
    with pytest.raises(CpbenchError) as refusal:
        grids.grid(text)
    assert word in str(refusal.value)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("text", ["soon", "-1s", "0", "10 days", ""])
def test_what_is_no_duration(text: str) -> None:
    with pytest.raises(CpbenchError, match="10s, 5m, 2h or none"):
        quantities.seconds(text)


def test_conversions_of_a_route_take_knobs() -> None:
    assert plan.pinned(["compliant[compliance=1e-2]"]).name == "fc-coneqp-compliant[compliance=0.01]"
    assert plan.pinned(["inner[facets=16]"], 8).via[0][1] == {"facets": 16}
    for text, told in (
        ("inner[sides=3]", "unknown parameter of fc-lcp-inner 'sides'"),
        ("inner[facets=many]", "facets is 'many', expected int"),
        ("inner[facets=3", "bracket is not closed"),
    ):
        with pytest.raises(CpbenchError, match=re.escape(told)):
            plan.pinned([text])
