"""The suites: which problems and solvers they take, what wins over them, and what they leave out."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from synthetic_results import pair as planned

from cpbench import graph, storage
from cpbench.analysis.participation import lacking_lines, unreached_lines
from cpbench.bench import skipped
from cpbench.bench.planning import grids, run_plan
from cpbench.bench.planning.plan import Pair
from cpbench.bench.results.rows import Outcome
from cpbench.bench.results.store import Store
from cpbench.cli import cli
from cpbench.errors import CpbenchError
from cpbench.formulations import LCP, formulations
from cpbench.generators.base import SMALL
from cpbench.generators.collection import builtin_folder, catalogue, unknowns
from cpbench.generators.quick import FEW, LARGEST, SMALLEST, quick_problems
from cpbench.solvers.base import missing, solvers

CORE = {formulation.node for formulation in formulations if formulation.core}


def _few() -> list[str]:
    return ["builtin/lcp/a.h5::p"]


def _made(given: Mapping[str, Any], *sets: Mapping[str, Any]) -> run_plan.RunPlan:
    return run_plan.make(given, {}, sets, suite=lambda name: run_plan.suite_values(name, _few))


def test_the_quick_problems_are_of_the_core_and_of_a_size_that_matters() -> None:
    folder = builtin_folder()
    chosen = quick_problems(folder)
    entries = {entry.address: entry for entry in catalogue() if entry.tier == SMALL}
    assert len(set(chosen)) == len(chosen)
    nodes = Counter(entries[address].node for address in chosen)
    assert set(nodes) == CORE
    assert max(nodes.values()) == FEW
    for address in chosen:
        entry = entries[address]
        problem = storage.load(f"{folder}/{address.removeprefix('builtin/')}")
        assert entry.known not in ("infeasible", "unbounded")
        assert problem.fingerprint == entry.fingerprint
        assert unknowns(problem) == entry.unknowns <= LARGEST
    for node, count in nodes.items():  # smaller ones only where there are too few
        large = [e for e in entries.values() if e.node == node and SMALLEST <= e.unknowns <= LARGEST]
        taken = [e for e in map(entries.__getitem__, chosen) if e.node == node and e.unknowns >= SMALLEST]
        assert len(taken) == min(FEW, len([e for e in large if e.known not in ("infeasible", "unbounded")]))
        assert count == FEW or count == len([e for e in entries.values() if e.node == node])


def test_families_take_turns_nearest_to_the_middle_first() -> None:
    lcp = [address for address in quick_problems(builtin_folder()) if address.startswith("builtin/lcp/")]
    families = [address.partition("::")[0] for address in lcp]
    assert len(set(families[:8])) == 8
    assert "builtin/lcp/lcp-classics.h5::murty-100" in lcp
    assert "builtin/lcp/lcp-planted.h5::harker-pang-100" in lcp


@pytest.mark.needs("cpbench_solvers")
def test_the_quick_solvers_come_with_cpbench_or_its_backends_and_reach_the_main_formulations() -> None:
    """The main formulations without any extra."""
    chosen = [solvers.get(name).spec for name in run_plan.quick_solvers()]
    assert not any(missing(spec) for spec in chosen)
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8"))["project"]
    extras = project["optional-dependencies"]
    core, more = (
        {text.split(">")[0].strip() for text in texts}
        for texts in (project["dependencies"], extras["backends"] + extras["casadi"])
    )
    assert {name for spec in chosen for name in spec.requires} <= core | more
    assert {"qp", "lcp", "micp", "vi", "nlp", "fc"} <= {spec.node for spec in chosen if {*spec.requires} <= core}


@pytest.mark.needs("cpbench_solvers")
def test_a_quick_solver_takes_every_quick_problem() -> None:
    """By an exact route, whatever the problem's own numbers say of it."""
    folder, nodes = builtin_folder(), sorted({solvers.get(name).spec.node for name in run_plan.quick_solvers()})
    for address in quick_problems(folder):
        problem = storage.load(f"{folder}/{address.removeprefix('builtin/')}")
        ends = [problem.node] if problem.node in nodes else nodes
        assert any(True for node in ends for _ in graph.arrivals(problem, node)), address


def test_without_problems_a_run_is_the_quick_suite() -> None:
    plan = _made({})
    (part,) = plan.sets
    assert (part.problems, part.solvers, part.routes) == (tuple(_few()), run_plan.quick_solvers(), "exact")
    assert part.timeout == run_plan.QUICK_SECONDS
    assert not part.chosen
    assert (plan.suite, str(plan.results), str(plan.report_folder)) == ("quick", "quick.sqlite", "reports/quick")


def test_the_larger_suites_are_all_built_in_problems() -> None:
    standard, full = _made({"suite": "standard"}), _made({"suite": "full"})
    assert standard.sets[0].problems == full.sets[0].problems == ("builtin",)
    assert (standard.sets[0].allowed_routes, full.sets[0].allowed_routes) == ("exact", "facets")
    assert (str(standard.results), str(full.results)) == ("standard.sqlite", "builtin.sqlite")
    assert (standard.builtin, full.builtin) == (False, True)
    word = run_plan.make({"problems": ("builtin",)}, {}, [], suite=lambda name: run_plan.suite_values(name, _few))
    assert replace(full.sets[0], suite="", routes="") == word.sets[0], "the word builtin is what it was"


def test_options_win_over_the_suite() -> None:
    plan = _made({"solvers": ("lemke",), "timeout": 1.0, "routes": "all"})
    (part,) = plan.sets
    assert (part.problems, part.solvers, part.timeout, part.routes) == (tuple(_few()), ("lemke",), 1.0, "all")
    assert part.chosen
    assert str(plan.results) == "run.sqlite", "its rows are not those of the suite"


def test_problems_and_a_suite_exclude_each_other() -> None:
    with pytest.raises(CpbenchError, match=r"suite full: has its own problems, and mine\.h5 is named too"):
        _made({"suite": "full", "problems": ("mine.h5",)})
    with pytest.raises(CpbenchError, match="leave one out"):
        _made({"suite": "full"}, {"name": "a", "problems": ("a.h5",)})


@pytest.mark.needs("cpbench_solvers")
def test_a_name_is_distinguished_from_a_glob() -> None:
    assert grids.named(["lemke", "newton-f*", "psor[omega=1.1|1.2]"]) == {"lemke", "psor"}
    assert grids.named(["all"]) == set()


def _pair(solver: str, problem: str, *, named: bool) -> Pair:
    return planned(0, solver, address=problem, problem=problem, fingerprint=f"f-{problem}", named=named)


def _settled(path: Path, pairs: list[Pair], outcomes: list[tuple[str, str]], absent: Mapping[str, str]) -> None:
    with Store(path, create=True) as store:
        store.plan(pairs)
        for pair, (status, message) in zip(pairs, outcomes, strict=True):
            store.finish(pair.key, Outcome(status=status, message=message))
        skipped.settle(store, pairs, absent)


def test_what_cannot_be_run_has_a_row_only_where_it_was_named(tmp_path: Path) -> None:
    pairs = [_pair(solver, p, named=solver == "asked") for solver in ("asked", "guest", "kept") for p in ("a", "b")]
    no_route, licence = ("unsupported", "conversion: M is not symmetric (0.3)"), ("unavailable", "licence: ask for one")
    outcomes = [no_route, licence, no_route, ("unsupported", "conversion: M is not symmetric (0.7)")]
    _settled(
        tmp_path / "r.sqlite",
        pairs,
        [*outcomes, licence, ("unavailable", "broken: a traceback")],
        {"gone": "pip install gone"},
    )
    with Store(tmp_path / "r.sqlite") as store:
        assert [(row.solver, row.status) for row in store.rows()] == [
            ("asked", "unsupported"), ("asked", "unavailable"), ("kept", "unavailable"),
        ], "who is broken is no one's choice"  # fmt: skip
        told = store.meta()["left_out"]
        assert [*lacking_lines(told), *unreached_lines(told)] == [
            "no licence: kept (ask for one)",
            "not installed: gone (pip install gone)",
            "no route from lcp to guest, 2 pairs: M is not symmetric (0.3)",
        ]
        assert set(skipped.statuses(store).values()) == {"unsupported", "unavailable"}
        again = {rerun: [p.key for p in skipped.planned(store, pairs, rerun)] for rerun in ("", "failed", "all")}
    assert again[""] == [pairs[k].key for k in (0, 1, 5)]
    assert again["failed"] == [pairs[k].key for k in (0, 1, 4, 5)]
    assert again["all"] == [pair.key for pair in pairs]


def test_a_pair_that_is_named_now_is_planned_again(tmp_path: Path) -> None:
    pair = _pair("guest", "a", named=False)
    _settled(tmp_path / "r.sqlite", [pair], [("unsupported", "solver: no")], {})
    with Store(tmp_path / "r.sqlite", create=True) as store:
        assert skipped.planned(store, [pair], "") == []
        asked = replace(pair, named=True)
        assert skipped.planned(store, [asked], "") == [asked]
        store.plan([asked])
        skipped.settle(store, [asked], {})
        assert store.meta()["left_out"] == []


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    M = np.array([[2.0, 1.0], [0.0, 2.0]])  # no symmetric matrix: some routes are closed
    storage.save(LCP(M=M, q=-np.ones(2), name="p"), tmp_path / "p.h5")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _run(*arguments: str) -> str:
    done = CliRunner().invoke(cli, list(arguments), catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.mark.needs("cpbench_solvers")
def test_a_run_ends_with_the_answer_and_info_says_it_again(folder: Path) -> None:
    said = _run("run", "p.h5", "-s", "newton-m?n", "-s", "mprg?", "--no-report", "-q")
    assert "newton-min" in said
    assert "lcp (linear complementarity problem): only newton-min ran: it solves 1 of 1 problem." in said
    assert "no route from lcp to mprgp, 1 pair:" in said
    assert said.rstrip().endswith("1 pair: 1 solved\nresults: run.sqlite")
    answer = said[: said.index("\n1 pair:")]
    assert _run("info", "run.sqlite") == answer
    named = _run("run", "p.h5", "-s", "mprgp", "--no-report", "-q")
    assert "2 pairs: 1 solved, 1 unsupported" in named
    assert "no route" not in named
