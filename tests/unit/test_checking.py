"""Checks of conversions: answers from files and solvers, both ends measured, broken lifts found, there and back."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import planted
import pytest
from command_line import exit_code
from tiers import by_night

from cpbench import graph, storage
from cpbench.conversions import Conversion, conversions, make
from cpbench.conversions.base import Size
from cpbench.formulations import LCP, MLCP, FrictionContact, Kind, LCPPoint, MLCPPoint
from cpbench.graph import checking


@dataclass(frozen=True)
class Crooked(Conversion):
    """lcp-mlcp whose lift is wrong by one part in a thousand."""

    name = "lcp-mlcp"
    source, target, kind, cost = "lcp", "mlcp", Kind.EQUIVALENT, 1.0

    def apply(self, problem):
        n = problem.q.size
        none, wide = np.zeros((0, 0)), np.zeros((0, n))
        return MLCP(A=none, B=problem.M, C=wide, D=wide.T, a=np.zeros(0), b=problem.q), {}

    def lift(self, point, trace):
        return LCPPoint(z=1.001 * point.v)

    def push(self, point, trace):
        return MLCPPoint(u=np.zeros(0), v=point.z)


@pytest.fixture
def crooked(monkeypatch):
    conversions.names()
    monkeypatch.setitem(conversions._items, "lcp-mlcp", Crooked)


@pytest.fixture
def lcp_file(tmp_path: Path) -> Path:
    """A planted LCP with its solution in the file."""
    problem, point = planted.lcp(np.random.default_rng(1), 8, "positive definite")
    path = tmp_path / "planted.h5"
    storage.save_answer(path, problem, point, {"solver": "planted"}, with_problem=True)
    return path


def test_a_known_solution_is_pushed_and_lifted(rng):
    problem, point = planted.mlcp(rng, 4, 5, "positive definite")
    report = checking.check(problem, "lcp", known=point)
    assert report.how == "known solution, pushed"
    assert report.arrival.route.label == "mlcp-lcp-schur"
    assert max(report.target.error, report.source.error) < 1e-12
    assert report.passed
    assert report.apply > 0
    assert report.lift > 0


def test_without_a_solution_a_native_solver_is_asked(rng):
    problem, point = planted.mlcp(rng, 4, 5, "positive definite")
    for known in (None, type(point)(u=point.u + 1.0, v=point.v)):
        report = checking.check(problem, "lcp", known=known, tolerance=1e-10)
        assert report.how.startswith("solved by ")
        assert report.source.error <= 1e-10
        assert report.passed
    assert "the known solution has error" in report.tried[0]


@pytest.mark.needs("cpbench_solvers")
@pytest.mark.parametrize("names", [["lemke", "pgs"], *by_night([None])], ids=["two solvers", "all"])
def test_nothing_is_passed_without_an_answer(monkeypatch, names):
    """w = −z − 1 < 0: there is no solution, and nobody finds one."""
    if names is not None:
        monkeypatch.setattr(checking, "solvers", [checking.solvers.get(name) for name in names])
    report = checking.check(LCP(M=-np.eye(2), q=-np.ones(2)), "mlcp")
    assert not report.how
    assert not report.passed
    assert any("lemke" in reason for reason in report.tried)


def test_amplification_is_measured_beside_the_answer(monkeypatch):
    """A lift that is right at the solution, and 1001 times too steep around it."""

    class Steep(Crooked):
        def lift(self, point, trace):
            return LCPPoint(z=point.v + 1000.0 * (point.v - np.round(point.v, 3)))

    conversions.names()
    monkeypatch.setitem(conversions._items, "lcp-mlcp", Steep)
    problem = LCP(M=2.0 * np.eye(2), q=[-3.0, 1.0])
    report = checking.check(problem, "mlcp", via=[make("lcp-mlcp")], known=LCPPoint(z=[1.5, 0.0]))
    assert report.source.error == report.target.error == 0
    assert report.moved == pytest.approx(1001.0, rel=0.01)


def test_a_broken_lift_is_found(crooked, rng):
    problem, point = planted.lcp(rng, 6, "positive definite")
    report = checking.check(problem, "mlcp", via=[make("lcp-mlcp")], known=point)
    assert report.target.error < 1e-12
    assert report.source.error > 1e-5
    assert report.amplification > 1e6
    assert not report.passed


def test_an_approximate_route_need_not_pass(rng):
    q = np.array([-1.0, 3.0, 4.0])  # slides in a direction between two facets
    problem = FrictionContact(W=np.eye(3), q=q, mu=[0.5], dimension=3)
    report = checking.check(problem, "lcp", via=[make("fc-lcp-inner")])
    assert report.target.solved
    assert not report.source.solved
    assert report.passed


def test_convert_check_prints_both_ends(monkeypatch, capsys, lcp_file):
    out = lcp_file.with_name("out.h5")
    assert exit_code(monkeypatch, "convert", lcp_file, out, "--to", "mlcp", "--check") == 0
    said = capsys.readouterr().out
    assert "check: known solution, pushed" in said
    assert "error there    0 on mlcp" in said
    assert "passes at 1e-06" in said
    assert "amplification" in said
    assert "seconds        convert" in said


def test_convert_check_ends_with_1_on_a_broken_lift(monkeypatch, capsys, lcp_file, crooked):
    out = lcp_file.with_name("out.h5")
    assert exit_code(monkeypatch, "convert", lcp_file, out, "--to", "mlcp", "--via", "lcp-mlcp", "--check") == 1
    assert "does not pass at 1e-06" in capsys.readouterr().out
    assert out.exists()


def test_route_all_shows_every_route_with_its_size(monkeypatch, capsys, lcp_file):
    assert exit_code(monkeypatch, "graph", lcp_file, "--to", "mlcp", "--to", "rfc", "--all", "--explain") == 0
    lines = capsys.readouterr().out.splitlines()
    problem = storage.load(lcp_file)
    every = list(graph.arrivals(problem, "mlcp"))
    shown = [line for line in lines if "nonzeros)" in line][1:]
    assert len(shown) == len(every) >= 3
    for line, arrival in zip(shown, every, strict=True):
        assert f"{arrival.route.cost:g}  {arrival.route.label} ({arrival.kind}; " in line
    assert "n = 0, m = 8, 64 nonzeros" in shown[0]
    assert any("out of reach" in line for line in lines)


def test_a_size_that_can_be_predicted_needs_no_conversion(monkeypatch, capsys, lcp_file):
    class Large(Crooked):
        def predict(self, problem):
            return Size.dense(10**6, 10**6)

        def apply(self, problem):
            raise AssertionError("converted")

    conversions.names()
    monkeypatch.setitem(conversions._items, "lcp-mlcp", Large)
    assert exit_code(monkeypatch, "graph", lcp_file, "--to", "mlcp", "--all") == 0
    said = capsys.readouterr().out
    assert "1  lcp-mlcp (equivalent; ~ 1000000 rows, 1000000000000 entries, 8e+03 GB at most)" in said
