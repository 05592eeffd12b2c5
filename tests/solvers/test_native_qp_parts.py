"""QPs of several connected parts, and in units far apart: claims are the verdict's, parts are solved by themselves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench.formulations import QP, QPPoint
from cpbench.formulations.conic import ConeQP
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.qp.claims import ErrorMeasure

NAMES = ["auto-qp", "interior-point-qp", "proximal-active-set", "augmented-lagrangian"]


def run(name: str, problem: Any, tolerance: float = 1e-6, **how: Any) -> Any:
    return solvers.get(name).run(problem, Budget(tolerance=tolerance), **how)


def planted(rng: np.random.Generator, n: int, unit: float, price: float) -> tuple[QP, QPPoint]:
    """Strictly convex, with inequalities, an equality and bounds around a strictly complementary solution; z in units
    of `unit`, the objective times `price`."""
    B, A, C = rng.standard_normal((n, n)), rng.standard_normal((n, n)), rng.standard_normal((1, n))
    Q, z = B @ B.T + np.eye(n), rng.standard_normal(n)
    lam = np.where(rng.random(n) < 0.3, rng.uniform(0.5, 2.0, n), 0.0)
    nu = np.where(rng.random(n) < 0.3, rng.uniform(0.5, 2.0, n), 0.0)
    mu = rng.standard_normal(1)
    lb, b = z - np.where(nu > 0.0, 0.0, 1.0), A @ z - np.where(lam > 0.0, 0.0, 1.0)
    p = A.T @ lam + C.T @ mu + nu - Q @ z
    problem = QP.build(price * Q / unit**2, price * p / unit, A / unit, b, C / unit, C @ z, unit * lb)
    return problem, QPPoint(unit * z, price * lam, price * mu, price * nu / unit)


def glued(parts: list[tuple[QP, QPPoint]]) -> tuple[QP, QPPoint]:
    """Return problems side by side as one, and their solutions."""

    def joined(values: list[Any]) -> Any:
        return np.concatenate(values)

    blocks = {
        name: sp.csr_array(sp.block_diag([sp.csr_array(getattr(P, name)) for P, _ in parts], format="csr"))
        for name in ("Q", "A", "C")
    }
    vectors = {name: joined([getattr(P, name) for P, _ in parts]) for name in ("p", "b", "d", "lb", "ub")}
    point = QPPoint(*(joined([getattr(x, name) for _, x in parts]) for name in ("z", "lam", "mu", "nu")))
    return QP(**blocks, **vectors), point


def side_by_side(seed: int, count: int, largest: int) -> tuple[QP, QPPoint]:
    rng = np.random.default_rng(seed)
    sizes = rng.integers(2, largest, count)
    return glued([planted(rng, int(n), *10.0 ** rng.uniform(-6, 6, 2)) for n in sizes])


def test_the_error_of_parts_is_the_verdicts() -> None:
    """In problems with the planted solution changed a little; 95 % within a tenth, for equilibrations end elsewhere."""
    near = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        problem, x = side_by_side(seed, int(rng.integers(1, 4)), 6)
        for size in (1e-9, 1e-6, 1e-3):
            z, lam, mu, nu = (v * (1.0 + size * rng.standard_normal(v.size)) for v in (x.z, x.lam, x.mu, x.nu))
            found = ErrorMeasure(problem).verdict((z, lam, mu, nu))
            near.append(found / judge(problem, QPPoint(z, lam, mu, nu), 1e-6).error)
    assert np.mean((np.array(near) > 1 / 1.1) & (np.array(near) < 1.1)) >= 0.95


@pytest.mark.parametrize(("count", "largest"), [(2, 4), (30, 12), (3, 130)])
def test_the_automatic_choice_solves_every_part(count: int, largest: int) -> None:
    """In one compiled call where parts are small; as large ones by themselves."""
    problem, x = side_by_side(7, count, largest)
    for tolerance in (1e-6, 1e-8):
        output = run("auto-qp", problem, tolerance)
        assert output.claim is Claim.SOLVED
        assert judge(problem, output.point, tolerance).solved
        np.testing.assert_allclose(output.point.z, x.z, rtol=1e-2)  # an interior point is right to the tolerance alone


def test_unknowns_alone_are_at_the_bound_that_their_price_asks_for() -> None:
    """By hand: ½z² − z is least at 1, z at its lower bound, −z at its upper one, and 0 where there is no price."""
    n = 200
    Q, p = sp.csr_array(sp.diags_array(np.tile([1.0, 0.0, 0.0, 0.0], n))), np.tile([-1.0, 1.0, -1.0, 0.0], n)
    output = run("auto-qp", QP.build(Q, p, lb=np.full(4 * n, -3.0), ub=np.full(4 * n, 5.0)))
    assert output.claim is Claim.SOLVED
    np.testing.assert_array_equal(output.point.z, np.tile([1.0, -3.0, 5.0, 0.0], n))


def test_a_part_without_a_solution_is_one_of_the_whole() -> None:
    """z₁ + z₂ ≥ 1 and −z₁ − z₂ ≥ 0 contradict each other, in the last part of many."""
    problem, _ = side_by_side(3, 30, 12)
    wrong = QP.build(np.eye(2), np.zeros(2), np.array([[1.0, 1.0], [-1.0, -1.0]]), np.array([1.0, 0.0]))
    whole, _ = glued([(problem, problem.zero_point()), (wrong, wrong.zero_point())])
    output = run("auto-qp", whole)
    assert output.claim is Claim.INFEASIBLE
    assert whole.certifies_infeasibility(output.certificate)


def far_apart(ratio: float, seed: int) -> QP:
    """Two coupled unknowns whose curvatures are up to `ratio`, and one by itself, with boxes and a sum as rows."""
    rng = np.random.default_rng(seed)
    roots = np.sqrt([ratio, 10.0 ** rng.uniform(0.0, np.log10(ratio)), 1.0])
    near = rng.uniform(-0.9, 0.9)
    Q = 20.0 * roots[:, None] * np.array([[1.0, near, 0.0], [near, 1.0, 0.0], [0.0, 0.0, 1.0]]) * roots
    p = np.append(Q.diagonal()[:2] * rng.uniform(-2, 2, 2), 0.0)
    top, low = rng.uniform(0.2, 4.0, 3), np.append(-rng.uniform(0.0, 1.0, 2) * rng.integers(0, 2, 2), 0.0)
    total = np.array([[1.0, 1.0, 0.0]])
    A, side = np.vstack([-np.eye(3), np.eye(3), -total, total]), 0.7 * top[:2].sum()
    return QP.build(Q, p, A, np.concatenate([-top, low, [-side, -side]]))


@pytest.mark.parametrize("exponent", [4, 12, 20, pytest.param(24, marks=pytest.mark.nightly)])
def test_units_far_apart_are_no_obstacle(exponent: int) -> None:
    """No false claim, and 95 of 100 solved up to 1e20: rows that are bounds are bounds in the end, which is exact."""
    solved = 0
    for seed in range(20):
        problem = far_apart(10.0**exponent, seed)
        output = run("auto-qp", problem, 1e-6)
        if output.claim is Claim.SOLVED:
            solved += 1
            assert judge(problem, output.point, 1e-6).solved
    assert solved >= (19 if exponent <= 20 else 15)


def test_a_small_part_is_not_hidden_by_a_large_one() -> None:
    """3e24 beside 20, and z₃ by itself, which is 0: 2 was claimed, for norms over all were met there."""
    Q = np.array([[3.1e24, -2.8930952254047917e21, 0.0], [-2.8930952254047917e21, 2.7e18, 0.0], [0.0, 0.0, 20.0]])
    A = np.vstack([-np.eye(3), np.eye(3), [[-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]]])
    b = np.array([-0.2, -0.2, -4.0, -0.2, -0.2, 0.0, -0.7, -0.7])
    problem = QP.build(Q, np.array([-5e24, 4e21, 0.0]), A, b)
    for name in NAMES:
        output = run(name, problem, 1e-6)
        assert output.claim is not Claim.SOLVED or abs(output.point.z[2]) <= 1e-5, name
    output = run("auto-qp", problem, 1e-6)
    assert output.claim is Claim.SOLVED
    np.testing.assert_allclose(output.point.z, [0.2, -0.2, 0.0], atol=1e-6)


def test_the_last_digits_of_the_interior_point_are_those_of_its_active_set() -> None:
    problem, x = planted(np.random.default_rng(1), 40, 1.0, 1.0)
    output = run("interior-point-qp", problem, 1e-13)
    assert output.claim is Claim.SOLVED
    np.testing.assert_allclose(output.point.z, x.z, rtol=1e-11)


@pytest.mark.parametrize("name", ["auto-coneqp", "interior-point-coneqp"])
def test_a_cone_program_with_flat_faces_is_measured_by_its_objective(name: str) -> None:
    """TAME of CUTE: the least (x₁ − x₂)² over x₁ + x₂ = 1, x ≥ 0, is 0: what is left counts beside nothing."""
    A = np.array([[1.0, 1.0], [1.0, 0.0], [0.0, 1.0]])
    K = ProductCone.of((Cone.ZERO, 1, 1), (Cone.NONNEGATIVE, 2, 1))
    Q = 2.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    problem = ConeQP.over(Q, np.zeros(2), K, A=A, b=np.array([-1.0, 0.0, 0.0]))
    for tolerance in (1e-4, 1e-6, 1e-8):
        output = run(name, problem, tolerance)
        assert output.claim is Claim.SOLVED
        assert judge(problem, output.point, tolerance).solved
