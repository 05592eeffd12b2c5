"""Proofs of infeasible and unbounded, against planted problems and near misses solved in rational arithmetic."""

from __future__ import annotations

import dataclasses
import zlib
from fractions import Fraction

import numpy as np
import planted
import pytest
import scipy.sparse as sp
from rational import exact, solved

from cpbench.formulations import AVI, LCP, MLCP, QP, ConeQP
from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.proofs import certified_infeasible, holds, packed, prove, unpacked
from cpbench.proofs.certificates import Infeasible, Unbounded
from cpbench.testing.cases import infeasible
from cpbench.verification import Status, no_answer, status

SEEDS = pytest.mark.parametrize(
    "seeds", [range(12), pytest.param(range(12, 200), marks=pytest.mark.nightly)], ids=["few", "many"]
)


def whole(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.integers(-5, 6, shape).astype(float)


def infeasible_lcp(seed: int) -> LCP:
    """y ≥ 0 with Mᵀy ≤ 0 and qᵀy < 0: the first row is what the others leave, exactly (integers) or with room."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 13))
    y = np.abs(whole(rng, n)) * (rng.random(n) < 0.6)
    y[0] = 1.0
    if seed % 2:
        M, q = whole(rng, n, n), whole(rng, n)
        room = np.abs(whole(rng, n)) * (rng.random(n) < 0.5)
    else:
        M, q = rng.standard_normal((n, n)) * 10.0 ** rng.integers(-6, 7), rng.standard_normal(n)
        room = 1e-3 * np.abs(M).max() * (1.0 + rng.random(n))
    M[0], q[0] = -(y[1:] @ M[1:]) - room, -(y[1:] @ q[1:]) - 1.0
    M, q = M * 2.0 ** rng.integers(-40, 40), q * 2.0 ** rng.integers(-40, 40)
    return LCP(M=sp.csr_array(M) if seed % 3 == 0 else M, q=q)


def infeasible_mlcp(seed: int) -> MLCP:
    """Integers with z ≥ 0, Aᵀy + Dᵀz = 0, Cᵀy + Bᵀz ≤ 0, aᵀy + bᵀz < 0; or doubles, whose Schur complement is ≤ 0."""
    rng = np.random.default_rng(1000 + seed)
    n, m = int(rng.integers(1, 8)), int(rng.integers(1, 8))
    if seed % 2:
        A, B, C, D, a, b = (whole(rng, *s) for s in ((n, n), (m, m), (n, m), (m, n), (n,), (m,)))
        y, z = whole(rng, n), np.abs(whole(rng, m))
        z[-1] = 1.0
        D[-1] = -(A.T @ y + D[:-1].T @ z[:-1])
        B[-1] = -(C.T @ y + B[:-1].T @ z[:-1]) - np.abs(whole(rng, m)) * (rng.random(m) < 0.5)
        b[-1] = -(a @ y + b[:-1] @ z[:-1]) - 1.0
    else:
        A, C, D, a = (rng.standard_normal(s) for s in ((n, n), (n, m), (m, n), (n,)))
        B = D @ np.linalg.solve(A, C) - 0.1 - rng.random((m, m))
        b = D @ np.linalg.solve(A, a) - 1.0
    return MLCP(A=A, B=B, C=C, D=D, a=a, b=b)


def infeasible_qp(seed: int) -> QP:
    """Constraints of integers that a combination contradicts: rows, equalities and bounds of every sort."""
    rng = np.random.default_rng(2000 + seed)
    n, m, k = int(rng.integers(1, 9)), int(rng.integers(1, 7)), int(rng.integers(0, 4))
    A, C, d, b = whole(rng, m, n), whole(rng, k, n), whole(rng, k), whole(rng, m)
    lb = np.where(rng.random(n) < 0.5, whole(rng, n), -np.inf)
    ub = np.where(rng.random(n) < 0.5, np.where(np.isfinite(lb), lb, 0.0) + np.abs(whole(rng, n)), np.inf)
    lam, mu = np.abs(whole(rng, m)), whole(rng, k)
    lam[0] = 1.0
    nu = whole(rng, n)  # of the bounds: its sign goes with a bound that is there
    nu = np.where(np.isfinite(lb) & np.isfinite(ub), nu, np.where(np.isfinite(lb), np.abs(nu), -np.abs(nu)))
    nu[np.isinf(lb) & np.isinf(ub)] = 0.0
    A[0] = -(A[1:].T @ lam[1:] + C.T @ mu + nu)
    bound = np.where(nu > 0, lb, np.where(nu < 0, ub, 0.0))
    b[0] = 1.0 - (b[1:] @ lam[1:] + d @ mu + bound @ nu)
    A, b = np.vstack([A, np.zeros(n)]), np.append(b, -1e20)  # a side that stands for none
    return QP.build(np.eye(n), whole(rng, n), A=A, b=b, C=C, d=d, lb=lb, ub=ub)


def unbounded_qp(seed: int) -> QP:
    """Integers with a point that meets the constraints and a ray along which the objective falls."""
    rng = np.random.default_rng(3000 + seed)
    n, m, k = int(rng.integers(2, 11)), int(rng.integers(0, 6)), int(rng.integers(0, 3))
    ray = whole(rng, n)
    ray[0] = 1.0

    def along(rows: int, value: np.ndarray) -> np.ndarray:
        """Rows whose product with the ray is `value`."""
        R = whole(rng, rows, n)
        R[:, 0] = value - R[:, 1:] @ ray[1:]
        return R

    B = along(int(rng.integers(1, n)), np.zeros(1))
    Q, p = B.T @ B, along(1, np.full(1, -1.0))[0]
    if seed % 3 == 0:  # curved along the ray, whatever the slope
        g = along(1, np.ones(1))[0]
        Q, p = Q - 8.0 * np.outer(g, g), whole(rng, n)
    A, C = along(m, np.abs(whole(rng, m)) * (rng.random(m) < 0.5)), along(k, np.zeros(k))
    point = whole(rng, n)
    b = A @ point - np.abs(whole(rng, m)) * (rng.random(m) < 0.5)
    lb = np.where((ray >= 0) & (rng.random(n) < 0.5), point - np.abs(whole(rng, n)), -np.inf)
    ub = np.where((ray <= 0) & (rng.random(n) < 0.5), point + np.abs(whole(rng, n)), np.inf)
    return QP.build(Q, p, A=A, b=b, C=C, d=C @ point, lb=lb, ub=ub)


@SEEDS
@pytest.mark.parametrize("make", [infeasible_lcp, infeasible_mlcp, infeasible_qp])
def test_what_is_planted_without_a_solution_is_proved(make, seeds: range) -> None:
    for seed in seeds:
        problem = make(seed)
        attempt = prove(problem, "infeasible")
        assert isinstance(attempt.proof, Infeasible), f"{seed}: {attempt.message}"
        assert holds(problem, attempt.proof)
        assert holds(problem, unpacked("infeasible", packed(attempt.proof)))


@SEEDS
def test_programs_without_a_least_value_are_proved(seeds: range) -> None:
    for seed in seeds:
        problem = unbounded_qp(seed)
        # a slope of 1 beside terms of up to 1e5: the margin of some is 2e-7
        attempt = prove(problem, "unbounded", tolerance=1e-8)
        assert isinstance(attempt.proof, Unbounded), f"{seed}: {attempt.message}"
        assert holds(problem, attempt.proof, 1e-8)
        assert holds(problem, unpacked("unbounded", packed(attempt.proof)), 1e-8)
        if seed % 5 == 0:
            assert prove(problem, "infeasible").proof is None


# -------------------------------------------------------------------------------- what has a solution, by very little


def near_block(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """M within 1e-12 of a matrix for which Mz + q ≥ 0 has no z ≥ 0, with a z > 0 that makes it 0 exactly."""
    rng = np.random.default_rng(4000 + seed)
    delta = float(rng.uniform(1e-13, 1e-11))
    row, column = 2.0 ** rng.integers(-20, 20, 2), 2.0 ** rng.integers(-20, 20, 2)
    M = np.array([[1.0, -1.0], [-1.0, 1.0 + delta]]) * row[:, None] * column
    q = np.array([-rng.uniform(0.1, 1.0), -rng.uniform(0.1, 1.0)]) * row
    z = solved(exact(M), [-Fraction(float(v)) for v in q])
    assert z is not None
    assert all(v > 0 for v in z)
    return M, q


def near_lcp(seed: int) -> tuple[LCP, np.ndarray]:
    """The block beside a diagonal one, permuted; both are P-matrices. The vector that excludes all but large z."""
    rng = np.random.default_rng(5000 + seed)
    block, side = near_block(seed)
    n = int(rng.integers(0, 5))
    M, q = np.diag(np.append(np.zeros(2), rng.uniform(1.0, 2.0, n))), np.append(side, whole(rng, n))
    M[:2, :2] = block
    y = np.append([1.0 / abs(block[0, 0]), 1.0 / abs(block[1, 0])], np.zeros(n))
    order = rng.permutation(n + 2)
    return LCP(M=M[np.ix_(order, order)], q=q[order]), y[order]


def near_mlcp(seed: int) -> tuple[MLCP, np.ndarray]:
    """The rows of the block as equalities in a free unknown each, A regular by 1e-12; or as those of v."""
    M, q = near_block(seed)
    none = np.zeros((0, 0))
    y = np.array([1.0 / abs(M[0, 0]), 1.0 / abs(M[1, 0])])
    if seed % 2:
        return MLCP(A=none, B=M, C=np.zeros((0, 2)), D=np.zeros((2, 0)), a=np.zeros(0), b=q), y
    return MLCP(A=M, B=none, C=np.zeros((2, 0)), D=np.zeros((0, 2)), a=q, b=np.zeros(0)), -y


def near_qp(seed: int) -> tuple[QP, np.ndarray]:
    """The block as rows or equalities; or two rows that leave one point, or a strip of 1e-12."""
    rng = np.random.default_rng(6000 + seed)
    M, q = near_block(seed)
    y = np.array([1.0 / abs(M[0, 0]), 1.0 / abs(M[1, 0])])
    if seed % 4 == 0:
        return QP.build(np.eye(2), np.zeros(2), A=M, b=-q, lb=np.zeros(2)), y
    if seed % 4 == 1:
        return QP.build(np.eye(2), np.zeros(2), C=M, d=-q), y
    n = int(rng.integers(1, 6))
    row, point = rng.standard_normal(n), whole(rng, n)
    side = sum((Fraction(a) * Fraction(z) for a, z in zip(row.tolist(), point.tolist(), strict=True)), Fraction(0))
    width = 1e-12 if seed % 4 == 2 else 0.0
    low = np.nextafter(float(side), -np.inf)
    high = np.nextafter(float(side), np.inf) + width
    assert Fraction(float(low)) <= side <= Fraction(float(high))
    return QP.build(np.eye(n), np.zeros(n), A=np.vstack([row, -row]), b=np.array([low, -high])), np.ones(2)


@SEEDS
@pytest.mark.parametrize("make", [near_lcp, near_mlcp, near_qp])
def test_what_has_a_solution_by_1e12_is_never_infeasible(make, seeds: range) -> None:
    for seed in seeds:
        problem, y = make(seed)
        assert not certified_infeasible(problem, y), seed
        assert prove(problem, "infeasible", y).proof is None, seed


@pytest.mark.parametrize("number", [12, pytest.param(50, marks=pytest.mark.nightly)])
def test_a_bounded_program_is_never_unbounded(number: int) -> None:
    """dᵀQd = 1e-12 along the only ray with a negative slope, p = 0, or no feasible point at all."""
    for seed in range(number):
        problem = unbounded_qp(3 * seed + 1)
        curved = dataclasses.replace(problem, Q=problem.Q + 1e-12 * np.eye(problem.p.size))
        assert prove(curved, "unbounded").proof is None, seed
    flat = QP.build(np.zeros((2, 2)), np.zeros(2))
    assert prove(flat, "unbounded").proof is None
    empty = QP.build(np.zeros((1, 1)), -np.ones(1), A=np.array([[1.0], [-1.0]]), b=np.ones(2))
    assert prove(empty, "unbounded").proof is None
    assert prove(empty, "infeasible").proof is not None


# ------------------------------------------------------------------------------------------------- tampering, rules


def test_a_changed_proof_holds_no_more() -> None:
    problem = LCP(M=-np.eye(2), q=-np.ones(2))
    assert holds(problem, Infeasible(np.ones(2)))
    for bad in ([], [1], [1, 1, 1], [0, 0], [-1, 1], [1, -1e-60], [1, np.nan]):
        assert not holds(problem, Infeasible(np.array(bad, dtype=float)))
    flat = QP.build(np.zeros((2, 2)), [-1.0, 0.0], C=np.array([[1.0, -3.0]]), d=[1.0])
    point, ray = np.array([1.0, 0.0]), np.array([3.0, 1.0])
    assert holds(flat, Unbounded(point, ray))
    for bad_point, bad_ray in (
        (point + np.array([1e-8, 0.0]), ray),
        (point, ray + np.array([0.0, 1e-14])),
        (point, -ray),
        (point, 0.0 * ray),
        (point[:1], ray),
        (point, ray[:1]),
    ):
        assert not holds(flat, Unbounded(bad_point, bad_ray))
    assert not holds(problem, Unbounded(point, ray))  # an LCP has no objective


@pytest.mark.parametrize(
    "data",
    [b"", b"no proof", zlib.compress(b"[]"), zlib.compress(b'{"ray": []}'),
     zlib.compress(b'{"multipliers": ["x"]}'), zlib.compress(b"{")],
)  # fmt: skip
def test_bytes_that_are_no_proof_are_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="no proof of kind 'infeasible'"):
        unpacked("infeasible", data)
    with pytest.raises(ValueError, match="no proof of kind 'wrong'"):
        unpacked("wrong", packed(Infeasible(np.ones(1))))


@pytest.mark.parametrize("node", ["lcp", "mlcp", "qp", "avi", "coneqp", "fc"])
def test_the_cases_of_the_nodes_are_proved(node: str) -> None:
    for case in infeasible(node):
        assert prove(case.problem, "infeasible").proof is not None, case.name


def test_sides_that_stand_for_none_prove_nothing() -> None:
    """z ≤ 1e19 against z ≥ 2e19 is a contradiction of numbers, but the first is no bound."""
    problem = QP.build(np.eye(1), np.zeros(1), A=np.ones((1, 1)), b=[2e19], ub=[1e19])
    assert prove(problem, "infeasible").proof is None
    assert prove(QP.build(np.eye(1), np.zeros(1), A=np.ones((1, 1)), b=[2e18], ub=[1e18]), "infeasible").proof
    idle = QP.build(np.zeros((1, 1)), [1.0], A=np.ones((1, 1)), b=[-1e19], lb=[-1e20])
    assert prove(idle, "unbounded").proof is not None
    assert prove(QP.build(np.zeros((1, 1)), [1.0], lb=[-1e18]), "unbounded").proof is None


def test_programs_over_polyhedral_cones() -> None:
    K = ProductCone.of((Cone.NONNEGATIVE, 1, 1), (Cone.ZERO, 1, 1), (Cone.FREE, 1, 1))
    A = np.array([[1.0, 0.0], [1.0, -2.0], [5.0, 5.0]])
    falling = ConeQP.over(np.zeros((2, 2)), np.array([0.0, -1.0]), K, A)
    assert prove(falling, "unbounded").proof is not None
    ball = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 1.0))
    assert "no proof of that is known" in prove(ConeQP.over(np.eye(3), np.zeros(3), ball), "infeasible").message


def test_a_variational_inequality_without_a_solution_over_a_set_with_points() -> None:
    """F = −1 pushes z up for ever; with a bound above, or F = z − 1, there is a solution."""
    assert prove(AVI(M=np.zeros((1, 1)), q=[-1.0], lb=[0.0]), "infeasible").proof is not None
    assert prove(AVI(M=np.zeros((1, 1)), q=[-1.0], lb=[0.0], ub=[1.0]), "infeasible").proof is None
    assert prove(AVI(M=np.eye(1), q=[-1.0], lb=[0.0]), "infeasible").proof is None


def test_nodes_without_a_rule_are_never_proved() -> None:
    for case in infeasible("soclcp") + infeasible("gfc"):
        assert prove(case.problem, "infeasible").proof is None
        assert not certified_infeasible(case.problem, np.ones(3))


def test_contacts_that_push_each_other_apart_or_cannot() -> None:
    """u₁N + u₂N = q₁N + q₂N, whatever the reactions, unless W gives a little; in 2D a tangent may push too."""
    wedge = np.array([[1.0, -1.0], [-1.0, 1.0]])
    for d, gives, told in ((2, 0.0, True), (3, 0.0, True), (2, 1e-12, False), (3, 1e-12, False)):
        W = np.kron(wedge + gives * np.eye(2), np.diag(np.eye(d)[0])) + np.kron(
            np.eye(2), np.eye(d) - np.diag(np.eye(d)[0])
        )
        squeezed = FrictionContact(W=W, q=np.tile(-np.eye(d)[0], 2), mu=[0.5, 0.5], dimension=d)
        assert (prove(squeezed, "infeasible").proof is not None) == told
    pulled = {
        "q": [-1.0, 0.0],
        "dimension": 2,
    }  # u_N = 3 r_T − 1 with r_T ≤ μ r_N; with −r_N in addition not for μ ≤ 1/3
    assert prove(FrictionContact(W=np.array([[-1.0, 3.0], [3.0, 9.0]]), mu=[0.3], **pulled), "infeasible").proof
    assert not prove(FrictionContact(W=np.array([[-1.0, 3.0], [3.0, 9.0]]), mu=[0.5], **pulled), "infeasible").proof


def test_contact_problems_with_a_solution_are_never_proved_to_have_none() -> None:
    for seed in range(40):
        rng = np.random.default_rng(seed)
        kind = ("positive definite", "singular semidefinite", "any")[seed % 3]
        problem, _ = planted.fc(rng, 1 + seed % 5, 2 + seed % 2, kind)
        assert prove(problem, "infeasible").proof is None


def test_a_status_follows_the_proof_and_no_claim() -> None:
    verdict = no_answer(1e-6)
    assert status(verdict, "infeasible") == status(verdict, "unbounded") == Status.FAILED
    assert status(verdict, "failed", proven_infeasible=True) == Status.INFEASIBLE
    assert status(verdict, "unbounded", proven_unbounded=True) == Status.UNBOUNDED
