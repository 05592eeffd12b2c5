"""Native MLCP solvers: kernels against plain NumPy, planted problems, Siconos' files, what has no solution."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import planted
import pytest
import scipy.sparse as sp

from cpbench import storage
from cpbench.formulations import LCP, MLCP, MLCPPoint
from cpbench.foundation import matrices
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.lcp import claims as lcp_claims
from cpbench_solvers.lcp.enumeration import enumerate_bases
from cpbench_solvers.mlcp.claims import scale
from cpbench_solvers.mlcp.enumeration import refined_answers
from cpbench_solvers.mlcp.pivoting import Reduction


def from_whole(K: np.ndarray, k: np.ndarray, n: int) -> MLCP:
    return MLCP(A=K[:n, :n], B=K[n:, n:], C=K[:n, n:], D=K[n:, :n], a=k[:n], b=k[n:])


def kkt(rng: np.random.Generator, n: int, m: int, *, flat: int = 0) -> MLCP:
    """Optimality conditions of a convex QP in n unknowns, `flat` of them without curvature, and m inequalities."""
    G = rng.standard_normal((n, n))
    A = G @ G.T + np.eye(n)
    A[:flat] = A[:, :flat] = 0.0
    D = rng.standard_normal((m, n))
    u, (v, w) = rng.standard_normal(n), planted.complementary(rng, m)
    return MLCP(A=A, B=np.zeros((m, m)), C=-D.T, D=D, a=D.T @ v - A @ u, b=w - D @ u)


def from_sparse(problem: MLCP) -> MLCP:
    parts = {name: sp.csr_array(getattr(problem, name)) for name in "ABCD"}
    return MLCP(**parts, a=problem.a, b=problem.b)


def test_the_error_is_that_of_the_norms(rng: np.random.Generator) -> None:
    """Whatever the units of the rows and of the unknowns."""
    for _ in range(40):
        row, column = 10.0 ** rng.uniform(-6, 6, (2, 9))
        K = rng.uniform(-1, 1, (9, 9)) * row[:, None] * column
        problem = from_whole(K, rng.uniform(-1, 1, 9) * row * (rng.random() < 0.8), 4)
        x = np.concatenate([rng.uniform(-1, 1, 4), rng.uniform(0, 1, 5)]) / column
        scaled = scale(problem)
        error = problem.residuals(MLCPPoint(u=x[:4], v=x[4:])).error
        inner = x / scaled.unit
        assert scaled.error(inner) == pytest.approx(error, rel=1e-9)
        sparse = scale(from_sparse(problem), keep_sparse=True)
        assert sparse.error(inner) == pytest.approx(error, rel=1e-9)


def test_scaling_keeps_symmetry_and_is_exact(rng: np.random.Generator) -> None:
    G = rng.standard_normal((9, 9)) * 10.0 ** rng.uniform(-4, 4, 9)
    problem = from_whole(G.T @ G, rng.standard_normal(9), 4)
    scaled, apart = scale(problem), scale(from_sparse(problem), keep_sparse=True)
    K = matrices.dense(scaled.K)
    np.testing.assert_array_equal(K, K.T)
    np.testing.assert_array_equal(K, matrices.dense(apart.K))
    for name in ("k", "unit", "row_unit"):
        np.testing.assert_array_equal(getattr(scaled, name), getattr(apart, name))
    assert 0.02 < abs(K).max(axis=1).min() <= abs(K).max() < 4.0
    np.testing.assert_array_equal(K * scaled.row_unit[:, None] / scaled.unit, G.T @ G)


def test_the_pairs_that_remain_are_the_schur_complement(rng: np.random.Generator) -> None:
    problem, _ = planted.mlcp(rng, 6, 7, "monotone")
    scaled = scale(problem)
    K, k, n = matrices.dense(scaled.K), scaled.k, scaled.free
    eliminated = np.linalg.solve(K[:n, :n], np.column_stack([K[:n, n:], k[:n]]))
    reduction = Reduction(scaled)
    np.testing.assert_allclose(reduction.M, K[n:, n:] - K[n:, :n] @ eliminated[:, :-1], rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(reduction.q, k[n:] - K[n:, :n] @ eliminated[:, -1], rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("flat", [1, 2, 4])
def test_pairs_exchange_their_roles_where_A_is_singular(flat: int) -> None:
    """What remains is the principal pivot transform of a monotone matrix: monotone, and its solutions are ours."""
    rng = np.random.default_rng(flat)
    scaled = scale(kkt(rng, 6, 9, flat=flat))
    reduction = Reduction(scaled)
    assert np.linalg.eigvalsh(reduction.M + reduction.M.T).min() > -1e-9
    pairs: Any = solvers.get("lemke").run(LCP(M=reduction.M, q=reduction.q), Budget(tolerance=1e-10))
    assert scaled.error(reduction.recover(pairs.point.z)) < 1e-9


def test_only_the_equations_of_the_pairs_have_an_order(rng: np.random.Generator) -> None:
    """Equalities in another order, with other signs: the same pivots."""
    problem = kkt(rng, 8, 12, flat=3)
    order, signs = rng.permutation(8), rng.choice([-1.0, 1.0], 8)[:, None]
    other = dataclasses.replace(
        problem, A=signs * problem.A[order], C=signs * problem.C[order], a=signs[:, 0] * problem.a[order]
    )
    first, second = (solvers.get("lemke-mlcp").run(p, Budget(tolerance=1e-10)) for p in (problem, other))
    assert first.claim is second.claim is Claim.SOLVED
    assert first.counters["pivots"] == second.counters["pivots"]


@pytest.mark.parametrize("solver", ["lemke-mlcp", "newton-min-mlcp", "newton-fb-mlcp", "pgs-mlcp"])
def test_sparse_problems_have_the_answers_of_dense_ones(solver: str) -> None:
    n, m = 120, 80
    rng = np.random.default_rng(3)
    G = sp.random_array((n + m, n + m), density=0.01, rng=rng)
    K = (G @ G.T + 2.0 * sp.eye_array(n + m)).toarray()
    v, w = planted.complementary(rng, m)
    k = np.concatenate([np.zeros(n), w]) - K @ np.concatenate([rng.standard_normal(n), v])
    dense = from_whole(K, k, n)
    sparse = dataclasses.replace(dense, **{name: sp.csr_array(getattr(dense, name)) for name in "ABCD"})
    first: Any
    second: Any
    first, second = (solvers.get(solver).run(p, Budget(tolerance=1e-10)) for p in (dense, sparse))
    assert first.claim is second.claim is Claim.SOLVED
    np.testing.assert_allclose(first.point.v, second.point.v, atol=1e-8)  # positive definite: one solution


@pytest.mark.parametrize(("n", "m", "flat"), [(4, 6, 0), (4, 6, 1), (12, 30, 0), (12, 30, 2), (30, 60, 0), (30, 60, 1)])
@pytest.mark.parametrize("store", [np.array, sp.csr_array])
def test_lemke_starts_from_the_basis_of_the_start(n: int, m: int, flat: int, store: Any) -> None:
    """From its own answer no pivot is left, from one near it few; a start of which no basis can be made is forgotten.
    A is singular in some: what is not regular without the pairs may be so with them."""
    rng = np.random.default_rng([n, m, flat])
    problem = kkt(rng, n, m, flat=flat)
    problem = MLCP(**{name: store(X) if np.ndim(X) == 2 else X for name, X in problem.data().items()})
    lemke, tight = solvers.get("lemke-mlcp"), Budget(tolerance=1e-9)
    cold = lemke.run(problem, tight)
    assert cold.claim is Claim.SOLVED
    assert cold.counters["pivots"] > 2
    warm = lemke.run(problem, tight, start=cold.point)
    assert warm.claim is Claim.SOLVED
    assert warm.counters["pivots"] == 0
    np.testing.assert_allclose(warm.point.v, cold.point.v, atol=1e-8)
    for other in (np.ones(m), rng.uniform(-1.0, 1.0, m)):
        found = lemke.run(problem, tight, start=MLCPPoint(u=rng.standard_normal(n), v=other))
        assert found.claim is Claim.SOLVED
        assert judge(problem, found.point, 1e-9).solved


def reference_sweeps(problem: MLCP, omega: float, sweeps: int) -> MLCPPoint:
    """Projected over-relaxed Gauss–Seidel, one component after the other (Cottle, Pang, Stone, 5.2)."""
    n = problem.a.size
    K = np.block([[problem.A, problem.C], [problem.D, problem.B]])
    k, x = np.concatenate([problem.a, problem.b]), np.zeros(problem.a.size + problem.b.size)
    for _ in range(sweeps):
        for i in range(x.size):
            x[i] -= omega * (K[i] @ x + k[i]) / K[i, i]
            if i >= n:
                x[i] = max(x[i], 0.0)
    return MLCPPoint(u=x[:n], v=x[n:])


@pytest.mark.parametrize("omega", [1.0, 1.3])
@pytest.mark.parametrize("sparse", [False, True])
def test_sweeps_are_those_of_plain_numpy(rng: np.random.Generator, omega: float, sparse: bool) -> None:
    problem, _ = planted.mlcp(rng, 5, 7, "positive definite")
    solver = solvers.get("pgs-mlcp")
    stored = {name: sp.csr_array(getattr(problem, name)) for name in "ABCD"} if sparse else {}
    asked = dataclasses.replace(problem, **stored)
    output: Any = solver.run(asked, Budget(tolerance=1e-16, iterations=5), solver.spec.options(omega=omega))
    expected = [reference_sweeps(problem, omega, count) for count in range(6)]
    best = min(expected, key=lambda point: problem.residuals(point).error)  # the best iterate is answered
    np.testing.assert_allclose(output.point.v, best.v, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(output.point.u, best.u, rtol=1e-9, atol=1e-11)


def test_equalities_are_put_into_an_order_with_a_diagonal(rng: np.random.Generator) -> None:
    problem, _ = planted.mlcp(rng, 4, 5, "positive definite")
    A = np.diag([3.0, 4.0, 5.0, 6.0])[[1, 2, 3, 0]]
    u, (v, w) = rng.standard_normal(4), planted.complementary(rng, 5)
    C, D, B = 0.1 * problem.C, 0.1 * problem.D, np.diag(np.diag(problem.B))
    turned = MLCP(A=A, B=B, C=C, D=D, a=-A @ u - C @ v, b=w - D @ u - B @ v)
    output = solvers.get("pgs-mlcp").run(turned, Budget(tolerance=1e-9))
    assert output.claim is Claim.SOLVED, output.message


def test_gauss_seidel_says_what_it_lacks() -> None:
    one, zero = np.eye(1), np.zeros((1, 1))
    no_B = small(one, zero, one, -one, [1.0], [1.0])
    assert "B[0,0] = 0" in (solvers.get("pgs-mlcp").obstacle(no_B) or "")
    no_A = small(zero, one, one, -one, [1.0], [1.0])
    assert "order of the equalities" in (solvers.get("pgs-mlcp").obstacle(no_A) or "")


def small(A: Any, B: Any, C: Any, D: Any, a: Any, b: Any) -> MLCP:
    """From lists."""
    return MLCP(A=A, B=B, C=C, D=D, a=a, b=b)


def test_certificates_are_checked() -> None:
    """u = −v − 1 and u ≥ 0 exclude each other for v ≥ 0; signs of y_e are free, those of y_v are not."""
    problem = small([[1.0]], [[0.0]], [[1.0]], [[1.0]], [1.0], [0.0])
    assert problem.certifies_infeasibility(np.array([-1.0, 1.0]))
    assert not problem.certifies_infeasibility(np.array([1.0, 1.0]))
    assert not problem.certifies_infeasibility(np.array([-1.0, 0.0]))
    assert not problem.certifies_infeasibility(np.array([-1.0, np.nan]))
    assert not problem.certifies_infeasibility(np.zeros(2))
    feasible = dataclasses.replace(problem, a=np.array([-1.0]))
    assert not feasible.certifies_infeasibility(np.array([-1.0, 1.0]))


def all_solutions(problem: MLCP) -> list[MLCPPoint]:
    """Return every solution that is isolated, and some of each face of others, by increasing number of their basis."""
    prepared, budget = scale(problem), Budget(tolerance=1e-8)
    reduction = Reduction(prepared)
    found = enumerate_bases(lcp_claims.scale(LCP(M=reduction.M, q=reduction.q)), budget)
    return [prepared.point(x) for _, x in refined_answers(prepared, reduction, found, budget)]


def test_all_solutions_of_a_problem_that_has_three() -> None:
    """u = −v₁ leaves the LCP of [[1, 2], [2, 1]] with q = −1 has 3 (Murty 1988, 1.3)."""
    problem = small([[1.0]], [[2.0, 2.0], [2.0, 1.0]], [[1.0, 0.0]], [[1.0], [0.0]], [0.0], [-1.0, -1.0])
    found = {tuple(np.round(point.v, 9)) for point in all_solutions(problem)}
    third = round(1 / 3, 9)
    assert found == {(1.0, 0.0), (0.0, 1.0), (third, third)}
    output = solvers.get("enumeration-mlcp").run(problem, Budget(tolerance=1e-9))
    assert output.counters["solutions"] == 3
    assert output.claim is Claim.SOLVED


@pytest.mark.parametrize("seed", range(6))
def test_enumeration_finds_what_least_squares_find(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem, _ = planted.mlcp(rng, 3, 5, "any")
    reference = planted.enumerate_mlcp(problem)
    assert reference is not None
    points = all_solutions(problem)
    assert any(np.allclose(point.v, reference.v, atol=1e-7) for point in points)


@pytest.mark.parametrize("solver", ["lemke-mlcp", "newton-min-mlcp"])
def test_every_file_of_siconos_to_eight_digits(shared_data: Path, solver: str) -> None:
    """The electronic circuits among them have a singular A, and an indefinite matrix as they are stored."""
    for file in sorted((shared_data / "mlcp").glob("*.dat")):
        if file.stem != "Rectangular_mlcp":  # not square
            problem = storage.load(file)
            output = solvers.get(solver).run(problem, Budget(tolerance=1e-8))
            assert output.claim is Claim.SOLVED, (file.stem, output.message)
