"""Programs without prices, whose objective is 0 at the solution, and rows without entries."""

from __future__ import annotations

import numpy as np
import pytest

from cpbench.formulations import LCP, QP, LCPPoint, QPPoint
from cpbench.verification import judge


def _to_rest(multiplier: float) -> tuple[QP, QPPoint]:
    """Return min ½z₁² with z₁ + z₂ = 1, z₂ ≤ 2 and z₂ ≥ 0 as a row, and the solution (0, 1) but for its multiplier.

    It is balanced by the equality's and by 1e-10 in z₁; its product with the slack 1 of the row is a gap.
    """
    problem = QP.build(
        np.diag([1.0, 0.0]), np.zeros(2), A=np.array([[0.0, 1.0]]), b=np.zeros(1),
        C=np.ones((1, 2)), d=np.ones(1), ub=np.array([np.inf, 2.0]),
    )  # fmt: skip
    z = np.array([-multiplier, 1.0 + multiplier])
    mu = np.array([-multiplier])
    return problem, QPPoint(z=z, lam=-mu, mu=mu, nu=np.zeros(2))


@pytest.mark.parametrize(("multiplier", "solved"), [(1e-8, True), (1e-5, False)])
def test_an_objective_near_0_is_optimal_whatever_multipliers_say(multiplier: float, solved: bool) -> None:
    """½z₁² = ½ 10⁻¹⁶ is within 10⁻¹² of what z₁ = 1 would be; the gap alone, 10⁻⁸, is not."""
    problem, point = _to_rest(multiplier)
    assert judge(problem, point, 1e-6).solved == solved


def test_an_objective_of_0_says_nothing_of_a_program_that_is_not_convex() -> None:
    """½(z₁² − z₂²) is 0 in (1, 1), where z₁ could fall and z₂ could rise."""
    none = np.zeros(0)
    problem = QP.build(np.diag([1.0, -1.0]), np.zeros(2), lb=np.zeros(2), ub=np.full(2, 2.0))
    point = QPPoint(z=np.ones(2), lam=none, mu=none, nu=np.array([1.0, -1.0]))
    assert judge(problem, point, 1e-6).error > 0.1


def test_rounding_of_an_objective_near_0_is_none(rng: np.random.Generator) -> None:
    """Mz = 0 but for rounding, and only z = 0 has a price: the root of rounding is 1e-8."""
    z, M = rng.uniform(0.5, 2.0, 12), rng.standard_normal((12, 12))
    M -= np.outer(M @ z, z) / (z @ z)
    problem = LCP(M=np.block([[M, np.zeros((12, 1))], [np.full((1, 12), 0.2), 0.0]]), q=12 * [0.0] + [1.0])
    assert judge(problem, LCPPoint(z=np.append(z, 0.0)), 1e-8).error < 1e-12
    assert not judge(problem, LCPPoint(z=np.append(1.001 * z[:1], np.append(z[1:], 0.0))), 1e-8).solved


@pytest.mark.parametrize("price", [0.0, -1.0])
@pytest.mark.parametrize(("multiplier", "solved"), [(0.0, True), (1.0, False)])
def test_a_row_without_entries_is_paid_for_in_the_objective(price: float, multiplier: float, solved: bool) -> None:
    """0 ≥ −1 beside min ½z² + price z with z ≥ 1: λ = 1 costs 1, which is twice the objective or the same."""
    problem = QP.build(np.eye(1), np.array([price]), A=np.zeros((1, 1)), b=np.array([-1.0]), lb=np.ones(1))
    point = QPPoint(z=np.ones(1), lam=np.array([multiplier]), mu=np.zeros(0), nu=np.array([1.0 + price]))
    assert judge(problem, point, 1e-6).solved == solved
