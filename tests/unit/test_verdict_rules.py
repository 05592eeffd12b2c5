"""Rules of the verdict, each with a small problem by hand that is judged falsely without it."""

from __future__ import annotations

import numpy as np
import pytest

from cpbench.formulations import QP, GFCPoint, GlobalFrictionContact, LCPPoint, QPPoint, Relay
from cpbench.verification import judge


def _held(as_row: bool, z2: float, off: float) -> tuple[QP, QPPoint]:
    """min ½zᵀQz + 10⁶ z₁ − z₂ over z₁ ≥ 0, a bound or a row: z = (0, 1), and a force of 10⁶ + 0.1, here `off` it."""
    Q, z = np.array([[1.0, 0.1], [0.1, 1.0]]), np.array([0.0, z2])
    force = 1e6 + 0.1 * z2 + off
    if as_row:
        problem = QP.build(Q, [1e6, -1.0], A=np.array([[1.0, 0.0]]), b=[0.0])
        return problem, QPPoint(z=z, lam=np.array([force]), mu=np.zeros(0), nu=np.zeros(2))
    problem = QP.build(Q, [1e6, -1.0], lb=[0.0, -np.inf])
    return problem, QPPoint(z=z, lam=np.zeros(0), mu=np.zeros(0), nu=np.array([force, 0.0]))


@pytest.mark.parametrize("as_row", [False, True])
@pytest.mark.parametrize(("z2", "off", "solved"), [(1.0, 0.0, True), (1.0, 1e-4, True), (1.001, 0.0, False)])
def test_the_force_of_a_bound_hides_nothing_however_it_is_written(
    as_row: bool, z2: float, off: float, solved: bool
) -> None:
    """A gradient of 10⁻³ beside prices of 1 is wrong; 10⁻⁴ of a force of 10⁶ is not."""
    verdict = judge(*_held(as_row, z2, off), 1e-6)
    assert verdict.solved == solved, verdict.error


def test_multipliers_of_a_row_that_is_given_twice_may_cancel() -> None:
    """min ½(z₁² + z₂²) + z₁ + z₂ over z₁ + z₂ ≥ 2 and ≤ 2, off by 10⁻⁷: λ = (t + z₁ + 1, t)."""
    problem = QP.build(np.eye(2), [1.0, 1.0], A=np.array([[1.0, 1.0], [-1.0, -1.0]]), b=[2.0, -2.0])
    z, t = 1.0 + 5e-8, 1e4
    point = QPPoint(z=np.full(2, z), lam=np.array([t + z + 1.0, t]), mu=np.zeros(0), nu=np.zeros(2))
    verdict = judge(problem, point, 1e-6)
    assert verdict.solved, verdict.error


@pytest.mark.parametrize(("z", "solved"), [(2.0, True), (0.5, False)])
def test_a_program_without_an_objective_needs_no_multipliers(z: float, solved: bool) -> None:
    """Find z ≥ 1: multipliers of 10⁻⁹ are what is left of 0, and have no price to be compared with."""
    problem = QP.build(np.zeros((1, 1)), [0.0], A=np.ones((1, 1)), b=[1.0])
    point = QPPoint(z=np.array([z]), lam=np.array([1e-9]), mu=np.zeros(0), nu=np.zeros(1))
    assert judge(problem, point, 1e-6).solved == solved


def test_an_unknown_beyond_a_finite_set_is_wrong_where_no_row_depends_on_it() -> None:
    """0 ≤ z ≤ 10⁻³ beside w = (0, z₂ − 10⁻³/2): z₁ = 1.5 · 10⁻³ is off by half of its set."""
    problem = Relay(M=np.diag([0.0, 1.0]), q=np.array([0.0, -5e-4]), lb=np.zeros(2), ub=np.full(2, 1e-3))
    assert judge(problem, LCPPoint(z=np.array([1.5e-3, 5e-4])), 1e-6).error == pytest.approx(0.5)


@pytest.mark.parametrize(("off", "solved"), [(0.0, True), (1e-5, False)])
@pytest.mark.parametrize("gap", [1e-6, 1e-9, 1e-12])
def test_rounding_of_a_fast_contact_is_no_distance_from_its_cone(gap: float, off: float, solved: bool) -> None:
    """A body of mass 1 slides with speed 1 under a normal impulse of 1, μ = 0.3: v = (−w, 1, 0), r = (1, −0.3, 0).

    û = (0.3, 1, 0) is on the boundary of the dual cone. Its components are known to 10⁻¹⁵, a thousandth of w = 10⁻¹².
    """
    mu, r, v = 0.3, np.array([1.0, -0.3, 0.0]), np.array([-gap, 1.0, 0.0])
    problem = GlobalFrictionContact(M=np.eye(3), H=np.eye(3), f=v - r, w=np.array([gap, 0.0, 0.0]), mu=np.array([mu]))
    moved = np.array([0.0, off, 0.0])  # of both, so that the dynamics hold: friction that is too small
    verdict = judge(problem, GFCPoint(v=v + moved, r=r + moved), 1e-6)
    assert verdict.solved == solved, verdict.error
