"""Error measures: against Siconos' own functions (run in its interpreter), and on answers made to fool them."""

from __future__ import annotations

import json
import math
import subprocess
from pathlib import Path

import numpy as np
import pytest

from cpbench.formulations import (
    LCP,
    MLCP,
    QP,
    FCPoint,
    FrictionContact,
    LCPPoint,
    MLCPPoint,
    QPPoint,
)
from cpbench.verification import judge

SYSTEM_PYTHON = Path("/usr/bin/python3")


def _siconos(cases: list[dict]) -> list[float]:
    script = Path(__file__).with_name("siconos_errors.py")
    probe = SYSTEM_PYTHON.exists() and subprocess.run(
        [SYSTEM_PYTHON, "-c", "import siconos.numerics"], capture_output=True
    )
    if not probe or probe.returncode:
        pytest.skip("needs Siconos in the system's Python: apt-get install python3-siconos")
    done = subprocess.run([SYSTEM_PYTHON, script], input=json.dumps(cases), capture_output=True, text=True, check=True)
    return json.loads(done.stdout.split("VALUES")[1])


def test_natural_residuals_agree_with_siconos(rng: np.random.Generator) -> None:
    """lcp_compute_error, fc3d_compute_error and mlcp_compute_error on random points, to 1e-12."""
    cases, ours = [], []
    for n in (1, 2, 7, 30):
        M, q, z = rng.standard_normal((n, n)), rng.standard_normal(n), rng.standard_normal(n)
        cases.append({"kind": "lcp", "M": M.tolist(), "q": q.tolist(), "z": z.tolist()})
        ours.append(LCP(M=M, q=q).residuals(LCPPoint(z=z)).measured["natural"])
    for nc, scale in ((1, 1.0), (4, 1e-3), (12, 1e4)):
        A = rng.standard_normal((3 * nc, 3 * nc))
        W, q, r = A @ A.T, rng.standard_normal(3 * nc), scale * rng.standard_normal(3 * nc)
        mu = rng.uniform(0, 1, nc)
        cases.append({"kind": "fc3d", "W": W.tolist(), "q": q.tolist(), "mu": mu.tolist(), "r": r.tolist()})
        ours.append(FrictionContact(W=W, q=q, mu=mu, dimension=3).residuals(FCPoint(r=r)).measured["natural"])
    for n, m in ((1, 1), (2, 2), (4, 4)):  # Siconos 4.4 corrupts memory when the two sizes differ
        M, q, z = rng.standard_normal((n + m, n + m)), rng.standard_normal(n + m), rng.standard_normal(n + m)
        cases.append({"kind": "mlcp", "n": n, "M": M.tolist(), "q": q.tolist(), "z": z.tolist()})
        problem = MLCP(A=M[:n, :n], C=M[:n, n:], D=M[n:, :n], B=M[n:, n:], a=q[:n], b=q[n:])
        ours.append(problem.residuals(MLCPPoint(u=z[:n], v=z[n:])).parts["siconos_mlcp"])
    theirs = _siconos(cases)
    for case, mine, reference in zip(cases, ours, theirs, strict=True):
        assert mine == pytest.approx(reference, rel=1e-12, abs=1e-14), case["kind"]


def _sliding(q_t: float, angle: float) -> tuple[FrictionContact, np.ndarray]:
    """One contact, W = I, μ = 0.5, pressed with 1 and dragged with q_t in direction `angle`; the exact r."""
    direction = np.array([math.cos(angle), math.sin(angle)])
    problem = FrictionContact(W=np.eye(3), q=np.concatenate([[-1.0], q_t * direction]), mu=[0.5], dimension=3)
    return problem, np.concatenate([[1.0], -0.5 * direction])


def test_a_wrong_direction_is_flagged() -> None:
    """Four facets at 44°: the nearest vertices are 44° and 46° off, and at speed the scaled error hides it."""
    angle = math.radians(44.0)
    problem, exact = _sliding(10000.0, angle)
    facet = np.array([1.0, -0.5, 0.0])
    right, wrong = judge(problem, FCPoint(r=exact), 1e-4), judge(problem, FCPoint(r=facet), 1e-4)
    assert right.solved
    assert "direction" not in right.flags
    # the chord over the speed, but for the size of a contact: that of W r + q and not of u alone
    assert wrong.error == pytest.approx(2 * 0.5 * math.sin(angle / 2) / 10000, rel=1.0)
    assert wrong.solved
    assert wrong.flags == ("direction",)
    assert wrong.parts["slip_angle [deg]"] == pytest.approx(44.0, abs=0.01)
    assert right.parts["slip_angle [deg]"] == pytest.approx(0.0, abs=1e-6)


def test_qp_components_take_the_smaller_of_absolute_and_relative() -> None:
    problem = QP.build(np.eye(1) * 1e6, np.array([-1e6]))
    point = QPPoint(z=[1.0 + 1e-9], lam=[], mu=[], nu=[0.0])
    residuals = problem.residuals(point)
    assert residuals.parts["stationarity_absolute"] == pytest.approx(1e-3, rel=1e-3)
    assert residuals.measured["stationarity"] == pytest.approx(1e-9, rel=1e-3)


def test_farkas_certificate() -> None:
    """Pang's isolated solution (Cottle, Pang, Stone) perturbed: w₁ = −z₂ − z₃ − 1e-4 < 0 for every z ≥ 0."""
    M = np.array([[0.0, -1, -1], [1, 0, 0], [-1, 0, 1]])
    infeasible = LCP(M=M, q=[-1e-4, -1, 1])
    assert infeasible.certifies_infeasibility(np.array([1.0, 0, 0]))
    assert not infeasible.certifies_infeasibility(np.array([0.0, 1, 0]))
    assert not LCP(M=M, q=[0.0, -1, 1]).certifies_infeasibility(np.array([1.0, 0, 0]))
    assert judge(LCP(M=M, q=[0.0, -1, 1]), LCPPoint(z=[1.0, 0, 0]), 1e-12).solved


@pytest.mark.parametrize("node", ["lcp", "mlcp"])
def test_a_rounding_error_beside_zero_is_no_wrong_answer(node: str) -> None:
    """z = 0 solves 0 ≤ z ⟂ z + 1 ≥ 0, and z = 1e-9 does so to 1e-9: it must not be measured on its own size."""
    tiny = np.array([1e-9])
    if node == "lcp":
        error = LCP(M=np.eye(1), q=[1.0]).residuals(LCPPoint(z=tiny)).error
    else:
        one = np.eye(1)
        problem = MLCP(A=one, B=one, C=0 * one, D=0 * one, a=[-1.0], b=[1.0])
        error = problem.residuals(MLCPPoint(u=[1.0], v=tiny)).error
    assert error == pytest.approx(1e-9, rel=1e-6)


def test_a_sticking_contact_has_no_direction_to_judge(rng: np.random.Generator) -> None:
    """A light sticking contact beside a heavy one: its velocity is rounding noise of the whole, not a slip."""
    W = np.eye(6) + 0.1  # coupled: two contacts that do not feel each other are judged each by itself
    r = np.array([1000.0, 0, 0, 1e-3, 1e-4, 0])
    u = np.array([0.0, 0, 0, 0, 1e-8, 0])
    problem = FrictionContact(W=W, q=u - W @ r, mu=[0.5, 0.5], dimension=3)
    verdict = judge(problem, FCPoint(r=r), 1e-6)
    assert verdict.solved
    assert "direction" not in verdict.flags


def test_a_small_column_does_not_hide_in_the_rounding_of_a_large_one() -> None:
    """diag(1, 1e-12), q = (−1, −1e-8): z = (1, 1e4) solves it, so that nothing may prove it infeasible."""
    problem = LCP(M=np.diag([1.0, 1e-12]), q=[-1.0, -1e-8])
    assert judge(problem, LCPPoint(z=[1.0, 1e4]), 1e-6).solved
    assert not problem.certifies_infeasibility(np.array([0.0, 1.0]))
