"""Start policies: what a solver starts from, what is told of it, and what is refused instead of starting cold."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import planted
import pytest
from synthetic_results import meta, row, table
from tiers import some_by_day
from written_reports import whole, write_report

from cpbench import graph, storage
from cpbench.analysis import starts
from cpbench.analysis import table as rows_of
from cpbench.analysis.ranking import rankings
from cpbench.bench.planning.assembly import assemble
from cpbench.bench.planning.run_plan import ProblemSet, RunPlan
from cpbench.bench.slot import Slot
from cpbench.bench.starts import (
    Before,
    StartKind,
    StartPolicy,
    carry,
    each_start,
    parse_start,
    start,
    start_for,
    step_before,
)
from cpbench.conversions.base import Conversion
from cpbench.conversions.local_contact import FCtoSOCLCP
from cpbench.errors import CpbenchError, NotApplicable, ProblemError, UnknownName
from cpbench.formulations import Contacts, FCPoint, FrictionContact, LCPPoint
from cpbench.generators.collection import builtin_folder
from cpbench.testing.cases import cases

COLD = StartPolicy()
FILE, PREVIOUS = StartPolicy(StartKind.FILE), StartPolicy(StartKind.PREVIOUS)


@pytest.fixture
def planted_fc(rng: np.random.Generator) -> tuple[FrictionContact, FCPoint]:
    return planted.fc(rng, 6, 3, "positive definite")


def kept(folder: Path, problem: Any, solution: Any, *guesses: Any) -> str:
    storage.save_answer(folder / "kept.h5", problem, solution, {}, with_problem=True, guesses=guesses)
    return str(folder / "kept.h5")


# ---------------------------------------------------------------------------------------------- the text


@pytest.mark.parametrize(
    ("text", "policy", "canonical"),
    [
        ("cold", COLD, "cold"),
        ("file", FILE, "file"),
        (" previous ", PREVIOUS, "previous"),
        ("file:1", FILE, "file"),
        ("file:3", StartPolicy(StartKind.FILE, guess=3), "file:3"),
    ],
)
def test_policies_have_one_text(text: str, policy: StartPolicy, canonical: str) -> None:
    assert parse_start(text) == policy
    assert str(policy) == canonical
    assert parse_start(canonical) == policy
    assert policy.warm == (text != "cold")


@pytest.mark.parametrize("text", ["", "warm", "colt", "cold:1", "file:", "previous:2", "Cold", "perturbed:0.1"])
def test_unknown_policies_are_refused_with_the_known_ones(text: str) -> None:
    with pytest.raises(UnknownName, match="unknown start") as refusal:
        parse_start(text)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("text", ["file:0", "file:-1", "file:x", "file:1.5", "file:²", "file: 2"])
def test_guesses_are_counted_from_one(text: str) -> None:
    with pytest.raises(CpbenchError, match="expected its number from 1 on, as in file:2"):
        parse_start(text)


# -------------------------------------------------------------------------------------------- cold and file


def test_the_first_guess_of_a_file(planted_fc: Any, tmp_path: Path) -> None:
    problem, point = planted_fc
    ones = FCPoint(r=np.ones(point.r.size))
    found = start_for(FILE, problem, kept(tmp_path, problem, point, ones, point))
    assert found.description == "file"
    np.testing.assert_array_equal(found.point.r, ones.r)


def test_every_guess_of_a_file_can_be_environment(planted_fc: Any, tmp_path: Path) -> None:
    problem, point = planted_fc
    ones = FCPoint(r=np.ones(point.r.size))
    storage.save_pack({"a": problem}, tmp_path / "pack.h5", guesses={"a": [point, ones, problem.zero_point()]})
    address = f"{tmp_path}/pack.h5::a"
    found = start_for(parse_start("file:2"), problem, address)
    assert found.description == "file:2"
    np.testing.assert_array_equal(found.point.r, ones.r)
    assert start_for(parse_start("file:3"), problem, address).description == "file:3: zeros"
    with pytest.raises(NotApplicable, match="start file:4: the file has 3 starting points, not 4"):
        start_for(parse_start("file:4"), problem, address)


def test_no_guess_is_no_cold_start(planted_fc: Any, tmp_path: Path, shared_data: Path) -> None:
    problem, point = planted_fc
    with pytest.raises(NotApplicable, match="the file has no starting point"):
        start_for(FILE, problem, kept(tmp_path, problem, point))
    text = str(shared_data / "fc3d_local" / "Rover1039.dat")
    with pytest.raises(NotApplicable, match="the file has no starting point"):
        start_for(FILE, storage.load(text), text)
    storage.save_answer(
        tmp_path / "nan.h5", problem, point, {}, with_problem=True, guesses=[FCPoint(r=np.full(18, np.nan))]
    )
    with pytest.raises(NotApplicable, match="is not finite"):
        start_for(FILE, problem, str(tmp_path / "nan.h5"))


# --------------------------------------------------------------------------------------------- the step before


def test_the_step_before(planted_fc: Any, rng: np.random.Generator, tmp_path: Path) -> None:
    problem, point = planted_fc
    nc = problem.nc
    here = Contacts(np.arange(nc), np.zeros((nc, 2)), np.zeros((nc, 3)), np.tile(np.eye(3), (nc, 1, 1)))
    placed = dataclasses.replace(problem, contacts=here)
    there = dataclasses.replace(here, id=np.arange(nc)[::-1])
    got = start_for(PREVIOUS, placed, "", Before(point, there))
    assert got.description == "previous"
    np.testing.assert_array_equal(got.point.r, point.r.reshape(-1, 3)[::-1].ravel())
    strangers = dataclasses.replace(here, id=np.arange(nc) + 50)
    description = start_for(PREVIOUS, placed, "", Before(point, strangers)).description
    assert description == "previous, no contact matched"
    by_order = start_for(PREVIOUS, problem, "", Before(point))
    assert by_order.description == "previous, contacts matched by order"
    assert start_for(PREVIOUS, problem, "").description == "cold: no step before"
    other = start_for(PREVIOUS, problem, "", Before(FCPoint(r=np.ones(3))))
    assert other.point is None
    assert other.description == "cold: 1 contacts before, 6 now, and no ids to match them by"


def test_a_step_is_read_again_from_its_file(planted_fc: Any, tmp_path: Path) -> None:
    problem, point = planted_fc
    geometry = Contacts(np.arange(6), np.zeros((6, 2)), np.zeros((6, 3)), np.tile(np.eye(3), (6, 1, 1)))
    storage.save(dataclasses.replace(problem, contacts=geometry), tmp_path / "step.h5")
    before = step_before(str(tmp_path / "step.h5"), None, problem.fingerprint, point.r)
    assert before.contacts is not None
    np.testing.assert_array_equal(before.contacts.id, np.arange(6))
    np.testing.assert_array_equal(before.point.r, point.r)
    with pytest.raises(ProblemError, match="the file changed after it was solved"):
        step_before(str(tmp_path / "step.h5"), None, "0" * 32, point.r)


# --------------------------------------------------------------------------------------- converted problems


@pytest.mark.parametrize(
    ("node", "target"),
    some_by_day([("gfc", "fc"), ("gfc", "soclcp"), ("fcm", "fc"), ("mlcp", "lcp"), ("lcp", "qp")], 2),
)
def test_a_guess_that_is_a_solution_arrives_as_one(node: str, target: str, tmp_path: Path) -> None:
    checked = 0
    for case in cases(node):
        if not any(x.any() for x in case.point.arrays().values()):
            continue
        try:
            arrival = graph.arrive(case.problem, target)
        except CpbenchError:
            continue
        steps = len(arrival.route.steps)
        address = str(tmp_path / f"{case.name}.h5")
        storage.save_answer(address, case.problem, case.point, {}, with_problem=True, guesses=[case.point])
        got = start(FILE, case.problem, address, arrival.problem, steps)
        assert arrival.problem.residuals(got.point).error < 1e-6, case.name
        checked += 1
    assert checked


def test_facets_carry_a_start(planted_fc: Any, tmp_path: Path) -> None:
    problem, point = planted_fc
    from cpbench.conversions.base import make

    inner = make("fc-lcp-inner", {"facets": 8})
    arrival = graph.arrive(problem, "lcp", via=(inner,))
    address = kept(tmp_path, problem, point, point)
    got = start(FILE, problem, address, arrival.problem, len(arrival.route.steps)).point
    assert isinstance(got, LCPPoint)
    back = graph.lift(arrival.problem, got)
    np.testing.assert_allclose(back.r.reshape(-1, 3)[:, 0], point.r.reshape(-1, 3)[:, 0], atol=1e-12)
    assert problem.residuals(back).error < 0.1


def test_what_cannot_be_carried_is_refused(planted_fc: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    problem, point = planted_fc
    converted = FCtoSOCLCP().step(problem)
    with pytest.raises(NotApplicable, match="start: no way to carry it to soclcp: it is not finite"):
        carry(FCPoint(r=np.full(point.r.size, np.inf)), converted, 1)
    monkeypatch.setattr(FCtoSOCLCP, "push", Conversion.push)
    with pytest.raises(NotApplicable, match="no way to carry it to soclcp: fc-soclcp: has no push"):
        carry(point, converted, 1)


# --------------------------------------------------------------------------------------------------- in files


def test_starting_points_go_along_when_a_problem_is_converted(tmp_path: Path, capsys: Any) -> None:
    """To other values of its parameters, to other formulations, and said where the format of OUT keeps none."""
    import casadi as ca

    from cpbench.cli import cli
    from cpbench.formulations import NCP, NCPPoint

    def convert(*words: str) -> str:
        cli(["convert", str(tmp_path / "m.h5"), *words], standalone_mode=False)
        return capsys.readouterr().err

    z, rate = ca.SX.sym("z", 2), ca.SX.sym("rate")
    problem = NCP.from_casadi(z, ca.vertcat(ca.exp(z[0]) - 2, rate * z[1] ** 3 - z[0]), {"rate": 1.0})
    points = [NCPPoint(z=[0.25, 1.0]), NCPPoint(z=[3.0, 3.5])]
    storage.save(problem, tmp_path / "m.h5", guesses=points)
    assert convert(str(tmp_path / "double.h5"), "--set", "rate=2") == ""
    assert storage.load(tmp_path / "double.h5").parameters == {"rate": 2.0}
    for name, node, part in (("double.h5", "", "z"), ("micp.h5", "micp", "z"), ("vi.h5", "vi", "x")):
        if node:
            assert convert(str(tmp_path / name), "--to", node) == ""
        found = storage.guesses(tmp_path / name)
        assert [point.arrays().get(part, point.arrays().get("z")).tolist() for point in found] == [
            [0.25, 1.0],
            [3.0, 3.5],
        ]


def test_what_keeps_no_starting_points_says_so(planted_fc: Any, tmp_path: Path, caplog: Any) -> None:
    problem, point = planted_fc
    storage.save(problem, tmp_path / "p.dat", guesses=[point, point])
    assert "keeps no starting points: 2 are left out" in caplog.text


def rows() -> pd.DataFrame:
    """Two solvers and three starts: one finds both solutions, the other one of them, and fails from the third."""

    def at(start: str, label: str, status: str = "solved") -> dict[str, Any]:
        return row("kojima", label, status, 1e-3, node="ncp", start=start, started=start, key=f"{start}/{label}")

    found = [at(start, label) for start in ("file", "file:2") for label in ("newton", "path")]
    return table(*found, at("file:10", "newton"), at("file:10", "path", "max_iter"))


def test_starts_are_cases_of_one_formulation_and_no_formulations(tmp_path: Path) -> None:
    [ranking] = rankings(rows_of.normalised(rows()))
    assert (ranking.formulation, ranking.problems_and_starts) == ("ncp", "1 problem, 3 starts")
    assert ranking.sentence == ("ncp: a hint from 1 problem, 3 starts: newton solves 3 of 3, alone on 1, fastest on 2.")
    text = whole(write_report(rows(), meta(), tmp_path, "t"))
    assert "one solver: ncp (1 problem, 3 starts).\n" in text
    assert "(1 problem, 2 solver configurations)" in text
    assert "--start file:10" in text, "the command that runs the failure again names its start"
    assert set(pd.read_csv(tmp_path / "results.csv")["start"]) == {"file", "file:2", "file:10"}


def test_one_start_is_as_it_was() -> None:
    clean = rows_of.normalised(rows()[lambda d: d["start"] == "file"])
    assert starts.merged(clean) is clean


@pytest.mark.needs("cpbench_solvers")
def test_a_plan_has_a_pair_for_each_start_of_a_file() -> None:
    """The file of Kojima and Shindo's problem has 8 starting points."""
    place = f"{builtin_folder()}/ncp/ncp-classics.h5::kojima-shindo"
    asked = ProblemSet(problems=(place,), solvers=("path-search",), start=("cold", "file:all"))
    with Slot() as slot:
        found = assemble(RunPlan(sets=(asked,)), slot, builtin_folder)
    assert [pair.start for pair in found.pairs] == ["cold", "file", *(f"file:{k}" for k in range(2, 9))]


def test_each_start_is_read() -> None:
    assert str(parse_start("file:all")) == "file:all"
    assert each_start("previous", 4) == ["previous"]
    with pytest.raises(CpbenchError, match="file:all"):
        parse_start("file:every")
