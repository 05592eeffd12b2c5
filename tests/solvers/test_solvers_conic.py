"""Solvers over cones and bounds: planted and published solutions, derivatives by differences, each against another."""

from __future__ import annotations

import numpy as np
import planted_conic
import pytest
from tiers import some_by_day

from cpbench.formulations import SOCLCP, ConeQP, Relay
from cpbench.formulations.conic import cone_fields
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.matrices import dense
from cpbench.solvers import Budget, Claim, solvers
from cpbench.solvers.shared.jacobians import box_jacobian, projection_jacobian
from cpbench.verification import judge
from cpbench_solvers.qp.scaling import equilibrate

TIGHT = Budget(tolerance=1e-10)
SHAPES = ProductCone.of(
    (Cone.SECOND_ORDER, 4, 3, np.array([0.0, np.inf, 1e-3, 1e3])),
    (Cone.SECOND_ORDER, 2, 1, 1.0),
    (Cone.SECOND_ORDER, 1, 9, 0.7),
    (Cone.ROLLING, 3, 5, np.array([0.0, 0.5, 0.0]), np.array([0.5, 0.0, 0.0])),
    (Cone.ROLLING_DUAL, 2, 3, np.array([0.0, 0.5]), 0.3),
    (Cone.CYLINDER, 2, 3, np.array([0.0, 0.75])),
)


@pytest.mark.parametrize("K", [planted_conic.cone(np.random.default_rng(3), cylinders=True), SHAPES])
def test_jacobians_are_those_of_differences(rng: np.random.Generator, K: ProductCone) -> None:
    """Central differences at random points, which are almost surely no kinks; symmetric between 0 and I."""
    h = 1e-6
    for _ in range(12):
        x = 2.0 * rng.standard_normal(K.rows)
        J = dense(projection_jacobian(K, x))
        columns = [(K.project(x + h * e) - K.project(x - h * e)) / (2 * h) for e in np.eye(K.rows)]
        np.testing.assert_allclose(J, np.array(columns).T, atol=1e-7)
        np.testing.assert_allclose(J, J.T, atol=1e-15)
        values = np.linalg.eigvalsh(J)
        assert values[0] > -1e-12
        assert values[-1] < 1 + 1e-12


def test_the_jacobian_of_a_box_is_one_inside() -> None:
    J = box_jacobian(np.array([-2.0, 0.5, 3.0, 0.0]), np.array([-1.0, -1, -1, 0]), np.array([1.0, 1, np.inf, 0]))
    np.testing.assert_array_equal(J.diagonal(), [0.0, 1.0, 1.0, 0.0])


def test_equilibration_takes_the_units_out(rng: np.random.Generator) -> None:
    """Rows of one group keep one factor, and a group's largest entry ends near 1."""
    groups = np.repeat(np.arange(6), 3)
    unit = 10.0 ** np.repeat(rng.uniform(-6, 6, 6), 3)
    M = (rng.standard_normal((18, 18)) + 4 * np.eye(18)) * unit[:, None] * unit
    d = equilibrate(M, groups)
    assert all(len(set(d[groups == g])) == 1 for g in range(6))
    top = np.abs(M * d[:, None] * d).max(axis=1).reshape(6, 3).max(axis=1)
    assert top.min() > 0.5
    assert top.max() < 2.0


@pytest.mark.parametrize("kind", some_by_day(["positive definite", "singular semidefinite", "monotone"], 1))
@pytest.mark.parametrize("sparse", [False, True])
def test_newton_reaches_ten_digits_on_monotone_cone_problems(kind: str, sparse: bool) -> None:
    """27 unknowns in every kind of factor, M nonsymmetric for `monotone`; from x = 0."""
    for seed in range(15):
        problem, _ = planted_conic.soclcp(np.random.default_rng(seed), None, kind, sparse=sparse)
        assert problem.symmetric == (kind != "monotone")
        output = solvers.get("newton-soclcp").run(problem, TIGHT)
        assert output.claim is Claim.SOLVED, f"{seed}: {output.message}"
        assert judge(problem, output.point, TIGHT.tolerance).solved


def test_projection_and_contraction_alone_converge(monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator) -> None:
    """Without Newton, on a rotation, where plain projection circles for ever: ‖F‖ falls in the norm of the paper."""
    from cpbench_solvers.cone import newton

    monkeypatch.setattr(newton, "_newton", lambda *_: None)
    K = ProductCone.of((Cone.SECOND_ORDER, 4, 3, 0.5))
    G = rng.standard_normal((12, 12))
    x, w = planted_conic.pair(rng, K)
    M = G - G.T
    problem = SOCLCP(M=M, q=w - M @ x, **cone_fields(K))
    output = solvers.get("newton-soclcp").run(problem, Budget(tolerance=1e-6))
    assert output.claim is Claim.SOLVED, output.message
    assert output.counters["factorizations"] == 1
    # the verdict's gap has units of its own where M is not symmetric
    assert judge(problem, output.point, 1e-5).solved


def test_newton_says_what_it_did_not_reach() -> None:
    """Indefinite M: solved only where it is, else the error in words, both by the measure that it stops by."""
    solver = solvers.get("newton-soclcp")
    for seed in range(10):
        problem, _ = planted_conic.soclcp(np.random.default_rng(seed), None, "any")
        output = solver.run(problem, Budget(tolerance=1e-8, iterations=300))
        error = problem.residuals(output.point, 1e-8).error
        assert (output.claim is Claim.SOLVED) == (error <= 1e-8)
        if error <= 1e-8:
            assert judge(problem, output.point, 1e-8).error <= 1e-6
        else:
            assert f"error {error:.1e}" in output.message


def test_clarabel_agrees_with_a_formula() -> None:
    """The nearest point of K to c is P_K(c) (min ½‖x‖² − cᵀx), unique, its multiplier P_K(c) − c; every factor."""
    rng = np.random.default_rng(5)
    for K in (SHAPES, planted_conic.cone(rng, cylinders=True)):
        c = 2.0 * rng.standard_normal(K.rows)
        output = solvers.get("clarabel-coneqp").run(ConeQP.over(np.eye(K.rows), -c, K), TIGHT)
        np.testing.assert_allclose(output.point.x, K.project(c), atol=1e-8)
        np.testing.assert_allclose(output.point.y, K.project(c) - c, atol=1e-8)


def test_clarabel_tells_infeasible_and_unbounded() -> None:
    solver = solvers.get("clarabel-coneqp")
    orthant = ProductCone.of((Cone.NONNEGATIVE, 1, 2))
    crossed = ConeQP.over(np.eye(1), np.zeros(1), orthant, np.array([[1.0], [-1.0]]), -np.ones(2))
    assert solver.run(crossed).claim is Claim.INFEASIBLE
    unbounded = ConeQP.over(np.zeros((2, 2)), -np.ones(2), orthant)
    assert solver.run(unbounded).claim is Claim.UNBOUNDED
    indefinite = ConeQP.over(np.diag([1.0, -1.0]), np.ones(2), orthant)
    assert "eigenvalue -1.0e+00" in str(solver.obstacle(indefinite))


def test_gauss_seidel_names_the_diagonal_it_cannot_use() -> None:
    solver = solvers.get("pgs-relay")
    problem = Relay(M=np.diag([1.0, 0.0]), q=np.ones(2), lb=-np.ones(2), ub=np.ones(2))
    assert "M[1,1] = 0" in str(solver.obstacle(problem))
    fixed = Relay(M=np.diag([1.0, 0.0]), q=np.ones(2), lb=[-1.0, 1.0], ub=[1.0, 1.0])
    assert solver.obstacle(fixed) is None
    assert solver.run(fixed).claim is Claim.SOLVED
