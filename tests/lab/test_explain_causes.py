"""What `explain` calls a cause, from which sizes on it looks for one, what else it complains of, and its time."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import cpbench as command
from planted_causes import local, tower

import cpbench as cp
from cpbench.formulations.base import formulations
from cpbench.verification import Status
from cpbench_lab.certificates.mixed import provable
from cpbench_lab.diagnosis.attempts import Deadline, OutOfTime, Raw, SolverTrial, TrialOutcome, attempt
from cpbench_lab.diagnosis.case import FailedTrial
from cpbench_lab.diagnosis.causes.structure import magnitude, masses
from cpbench_lab.diagnosis.diagnose import diagnose
from cpbench_lab.diagnosis.diagnosis import complaint_of
from cpbench_lab.diagnosis.even_masses import even_masses
from cpbench_lab.diagnosis.other_units import uniform

SLOW = cp.LCP(M=[[1.0, -0.99999], [-0.99999, 1.0]], q=[-1.0, 0.9], name="slow")
"""z = (1 − 0.9 c, c − 0.9)/(1 − c²), c = 0.99999; each sweep of Gauss and Seidel leaves c² of the error."""


def case_of(problem: Any, solver: str) -> FailedTrial:
    trial = SolverTrial(problem=problem, solver=solver)
    return FailedTrial(trial, attempt(trial), attempt)


def test_a_cause_is_printed_only_where_the_check_succeeds() -> None:
    """A hundred times one sweep is too few for SLOW."""
    found = cp.diagnose(SLOW, "pgs[max_iterations=1]")
    lines = list(found.lines())
    assert found.cause is None
    assert [one.cause.kind for one in found.suspected][:1] == ["iterations"]
    assert lines[0].startswith("slow by pgs[max_iterations=1]: max_iter; no cause was confirmed, suspected: iterations")
    assert any(line.startswith("  suspected, not confirmed: iterations") for line in lines)
    assert any("fails as well with 100 times the limit" in line for line in lines)
    assert not any(line.startswith("  cause      iterations") for line in lines)
    assert found.remedy is not None
    assert cp.verify(SLOW, found.remedy.answer).solved


@pytest.mark.parametrize(("decades", "there"), [(-4.0, True), (-2.0, False), (2.0, False), (4.0, True)])
def test_magnitude_is_looked_at_from_three_decades_on(decades: float, there: bool) -> None:
    size = 10.0**decades
    case = case_of(cp.LCP(M=[[2.0, 1.0], [1.0, 2.0]], q=[-3.0 * size, -3.0 * size]), "pgs[max_iterations=1]")
    found = magnitude(case)
    assert (found is not None) == there
    if found is not None:
        assert found.numbers["unknowns"] == pytest.approx(size)  # z = (1, 1) size


@pytest.mark.parametrize("node", ["lcp", "mlcp", "relay", "qp", "fc"])
def test_a_problem_of_size_one_leads_back(node: str) -> None:
    """Sizes become one to a factor of √2, zeros and ratios stay, and the answer is one of the problem."""
    rng = np.random.default_rng(5)
    n, small, large = 6, 2.0**-40, 2.0**30
    B = rng.standard_normal((n, n))
    K, q = small * (B @ B.T + np.eye(n)), small * large * rng.standard_normal(n)
    problem: Any = {
        "lcp": lambda: cp.LCP(M=K, q=q),
        "mlcp": lambda: cp.MLCP(A=K[:2, :2], C=K[:2, 2:], D=K[2:, :2], B=K[2:, 2:], a=q[:2], b=q[2:]),
        "relay": lambda: cp.Relay(M=K, q=q, lb=np.full(n, -large), ub=np.full(n, large)),
        "qp": lambda: cp.QP.build(
            K, q, A=1e5 * np.eye(2, n), b=np.full(2, -1e5 * large), C=1e-7 * np.ones((1, n)), d=np.array([1e-7 * large])
        ),
        "fc": lambda: cp.FrictionContact(W=K, q=q, mu=np.array([0.3, 0.4]), dimension=3),
    }[node]()
    for known in (None, cp.solve(problem, tolerance=1e-9).point):
        other = uniform(problem, known)
        assert other is not None
        answer = cp.solve(other.problem, tolerance=1e-9)
        back = other.back(answer.point)
        assert cp.verify(problem, back, tolerance=1e-6).solved
        again = uniform(other.problem, answer.point if known is not None else None)
        assert again is not None
        if known is not None:
            assert max(abs(math.log2(size)) for size in again.numbers.values()) <= 1.1


def test_a_problem_without_sizes_has_no_magnitude() -> None:
    assert uniform(cp.LCP(M=[[1.0]], q=[0.0]), None) is None


@pytest.mark.parametrize(("weight", "there"), [(55.0, False), (75.0, True)])
def test_masses_are_looked_at_where_modes_are_a_hundred_apart(weight: float, there: bool) -> None:
    """Two bodies on a point each. By hand, with c² = a²/(b² (1 + 1/weight)): the normals have a = b = 1, the tangents
    a = 0.25/0.16 − 1 and b = 0.25/0.16 + 1; eigenvalues are 1 ± c."""
    coupling = [a / b / math.sqrt(1.0 + 1.0 / weight) for a, b in ((1.0, 1.0), (0.25 / 0.16 - 1, 0.25 / 0.16 + 1))]
    ratio = (1.0 - coupling[1]) / (1.0 - coupling[0])
    for scene in (tower([1.0, weight], 1, 0.5, 0.01), local(tower([1.0, weight], 1, 0.5, 0.01))):
        found = even_masses(scene)
        assert found is not None
        assert (found.ratio, found.heavy, found.of) == (pytest.approx(ratio, rel=1e-9), 1, 4)
        assert (masses(case_of(scene, "nsgs[max_iterations=1]")) is not None) == there


def test_even_bodies_are_not_far_apart() -> None:
    """Not in a slender stack, which bends; nor on many feet, of which few are determined."""
    scene = local(tower(np.ones(10), 4, 0.5, 0.0))
    assert masses(case_of(scene, "nsgs[max_iterations=1]")) is None
    found = even_masses(scene)
    assert found is not None
    assert (found.of, found.ratio > 20.0) == (30, True)


@pytest.mark.parametrize("feet", [1, 4])
def test_even_masses_keep_the_contacts(feet: int) -> None:
    """Velocities that the bodies cannot have stay impossible; M' gives W', and the same motion without contacts."""
    scene = tower([1.0, 2.0, 1e4], feet, 0.5, 0.01)
    W = np.asarray(local(scene).W)
    of_W, of_M = even_masses(local(scene)), even_masses(scene)
    assert of_W is not None
    assert of_M is not None
    after, other = np.asarray(of_W.problem.W), np.asarray(of_M.problem.M)  # pyright: ignore[reportAttributeAccessIssue]
    H = np.asarray(scene.H)
    np.testing.assert_allclose(H.T @ np.linalg.solve(other, H), after, rtol=0, atol=1e-8 * np.abs(W).max())
    free = np.linalg.solve(other, of_M.problem.f)  # pyright: ignore[reportAttributeAccessIssue]
    np.testing.assert_allclose(free, np.asarray(scene.f) / np.diag(scene.M), rtol=0, atol=1e-12)
    assert np.linalg.matrix_rank(after, tol=1e-8) == np.linalg.matrix_rank(H) == min(9, 6 * feet)
    again = even_masses(of_W.problem)
    assert again is not None
    assert again.ratio < 100.0


def outcome(claim: str, seconds: float, status: str = Status.SOLVED) -> TrialOutcome:
    raw = Raw(claim=claim, seconds=seconds)
    return TrialOutcome(trial=SolverTrial(problem=SLOW, solver="pgs"), status=status, raw=raw)


@pytest.mark.parametrize(
    ("claim", "seconds", "fastest", "kind"),
    [
        ("solved", 9.0, 1.0, None),
        ("solved", 9.99, 0.8, "time"),  # more than ten times
        ("solved", 8.0, 1.2, None),
        ("solved", 9.0, 0.7, "time"),
        ("solved", 0.09, 1e-4, None),  # too short to matter
        ("solved", 0.11, 1e-4, "time"),
        ("solved", 10.5, math.inf, "time"),  # past its limit of 10 s
        ("solved", 9.5, math.inf, None),
        ("max_iter", 0.01, math.inf, "claim"),
        ("infeasible", 0.01, math.inf, "claim"),
    ],
)
def test_a_right_answer_may_have_a_complaint(claim: str, seconds: float, fastest: float, kind: str | None) -> None:
    found = complaint_of(outcome(claim, seconds), fastest)
    assert (None if found is None else found.kind) == kind
    if found is not None:
        assert not found.met(outcome(claim, seconds), True)
        assert found.met(outcome("solved", 0.01), True)


def test_a_wrong_answer_is_an_error_whatever_is_claimed() -> None:
    found = complaint_of(outcome("solved", 0.01, Status.WRONG), math.inf)
    assert found is not None
    assert found.kind == "error"


def test_a_claim_about_a_right_answer_is_explained() -> None:
    """HiGHS runs into its limit on a row of zeros beside a singular Q, and answers right (HiGHS, issue 2489)."""
    pytest.importorskip("highspy")
    qp = cp.QP.build(np.diag([1.0, 0.0]), np.array([1.0, 0.0]), A=np.zeros((1, 2)), b=np.array([-1.0]),
                     lb=np.full(2, -10.0), ub=np.full(2, 10.0))  # fmt: skip
    found = diagnose(SolverTrial(problem=qp, solver="highs", tolerance=1e-5))
    assert not found.fails
    assert found.complaint is not None
    assert found.complaint.kind == "claim"
    assert found.cause is not None
    assert found.cause.kind == "singular"
    assert "its answer is right, the complaint may be its claim" in next(found.lines())
    assert found.remedy is not None


def test_what_is_late_is_left() -> None:
    assert Deadline().run(lambda: 3) == Deadline.after(60.0).run(lambda: 3) == 3
    with pytest.raises(ZeroDivisionError):
        Deadline.after(60.0).run(lambda: 1 // 0)
    with pytest.raises(OutOfTime):
        Deadline.after(0.0).run(lambda: time.sleep(60.0))


def test_an_explanation_out_of_time_says_what_it_did_not_do(tmp_path: Path) -> None:
    late = Deadline.after(60.0)

    def slow_check(trial: SolverTrial) -> TrialOutcome:
        if trial.problem is not SLOW or trial.solver != "pgs[max_iterations=1]":
            raise OutOfTime
        return attempt(trial)

    found = diagnose(SolverTrial(problem=SLOW, solver="pgs[max_iterations=1]"), slow_check, deadline=late)
    assert found.fails
    assert "causes that were not looked for: " in found.unfinished
    assert "magnitude, masses, hyperstatic" in found.unfinished
    assert "not all remedies were tried" in found.unfinished
    assert diagnose(SolverTrial(problem=SLOW, solver="pgs"), deadline=Deadline.after(0.0)).unfinished
    cp.save(SLOW, tmp_path / "slow.h5")
    ended = command(tmp_path, "explain", "slow.h5", "-s", "pgs[max_iterations=1]", "--minutes", "1e-6")
    assert ended.returncode == 1
    assert "  unfinished " in ended.stdout


def test_other_families_and_a_certificate_are_offered(tmp_path: Path) -> None:
    cp.save(SLOW, tmp_path / "slow.h5")
    ended = command(tmp_path, "explain", "slow.h5", "-s", "pgs[max_iterations=1]")
    works = [line for line in ended.stdout.splitlines() if line.startswith("  tried") and ": works" in line]
    assert len(works) == 3, ended.stdout  # the automatic choice, another method, another formulation
    assert ", of " in works[2]
    assert "certify" in ended.stdout


@pytest.mark.parametrize("node", formulations.names())
def test_formulations_with_certificates_are_those_offered(node: str) -> None:
    pytest.importorskip("flint")
    from cpbench.testing.cases import cases

    problem = next((case.problem for case in cases(node)), None)
    if problem is None:
        pytest.skip(f"no case of {node}")
    reason = cp.certify(problem, problem.zero_point(), seconds=5.0).reason
    assert reason.startswith("no proof is known") == (not provable(node))
