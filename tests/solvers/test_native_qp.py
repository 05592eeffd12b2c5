"""Native QP solvers: planted and published solutions, degenerate, infeasible and unbounded problems, warm starts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import planted
import pytest
import scipy.sparse as sp

from cpbench import storage
from cpbench.formulations import QP
from cpbench.formulations.programs import QPPoint
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.kernels import minimum_degree, qp_ldl
from cpbench_solvers.qp.claims import ErrorMeasure, infeasibility, unboundedness
from cpbench_solvers.qp.presolve import presolved, sparse_data
from cpbench_solvers.qp.proximal_active_set import ProximalActiveSetOptions, in_one_call
from cpbench_solvers.qp.scaling import scaled

CONVEX = ("proximal-active-set", "interior-point-qp", "augmented-lagrangian")
ALL = ("dual-active-set", *CONVEX)
ACTIVE = ("dual-active-set", "proximal-active-set")


def solved(name: str, problem: QP, tolerance: float = 1e-6, **how: Any) -> Any:
    """The output, whose claim `solved` is true by our residuals."""
    output = solvers.get(name).run(problem, Budget(tolerance=tolerance), **how)
    assert output.claim is Claim.SOLVED, (name, output.message)
    assert problem.residuals(output.point).error <= tolerance
    return output


def nocedal_wright() -> QP:
    """Nocedal and Wright, Numerical Optimization (2006), example 16.4: z = (1.4, 1.7)."""
    A = np.array([[1.0, -2.0], [-1.0, -2.0], [-1.0, 2.0]])
    return QP.build(2.0 * np.eye(2), [-2.0, -5.0], A, [-2.0, -6.0, -2.0], lb=np.zeros(2))


def banded(n: int, rng: np.random.Generator) -> QP:
    """Sparse, with bounds, inequalities and equalities around a strictly complementary solution."""

    def rows(count: int) -> sp.csr_array:
        columns = (rng.integers(0, n - 5, (count, 1)) + rng.integers(0, 5, (count, 3))).ravel()
        return sp.csr_array(
            (rng.standard_normal(3 * count), (np.repeat(np.arange(count), 3), columns)), shape=(count, n)
        )

    G, A, C = rows(n), rows(n // 2), rows(n // 10)
    Q = sp.csr_array(G.T @ G + 0.1 * sp.eye_array(n))
    z, mu = rng.standard_normal(n), rng.standard_normal(n // 10)
    lam = np.where(rng.random(n // 2) < 0.4, rng.uniform(0.5, 2.0, n // 2), 0.0)
    nu = np.where(rng.random(n) < 0.2, rng.uniform(0.5, 2.0, n), 0.0)
    p = A.T @ lam + C.T @ mu + nu - Q @ z
    return QP.build((Q + Q.T) / 2, p, A, A @ z - (lam == 0), C, C @ z, lb=np.where(nu > 0, z, -np.inf))


@pytest.mark.parametrize("name", ALL)
def test_nocedal_and_wright_example_16_4(name: str) -> None:
    output = solved(name, nocedal_wright(), 1e-9)
    np.testing.assert_allclose(output.point.z, [1.4, 1.7], atol=1e-7)
    np.testing.assert_allclose(output.point.lam, [0.8, 0.0, 0.0], atol=1e-7)


@pytest.mark.parametrize("name", ALL)
def test_many_rows_through_one_vertex(name: str) -> None:
    """Forty rows that are all active at one point of six unknowns."""
    rng = np.random.default_rng(5)
    A, z = rng.standard_normal((40, 6)), rng.standard_normal(6)
    lam = np.where(np.arange(40) < 12, rng.uniform(0.5, 2.0, 40), 0.0)
    output = solved(name, QP.build(np.eye(6), A.T @ lam - z, A, A @ z))
    np.testing.assert_allclose(output.point.z, z, atol=1e-5)


@pytest.mark.parametrize("name", ACTIVE)
def test_gains_below_rounding_are_not_the_end(name: str) -> None:
    """min ½‖z‖², z ≥ l: beside z₁ = 1 the others raise the dual function, ½‖l‖², by less than its rounding."""
    lb = np.array([1.0, 1e-8, 1e-9, 1e-10])
    np.testing.assert_array_equal(solved(name, QP.build(np.eye(4), np.zeros(4), lb=lb), 1e-12).point.z, lb)


@pytest.mark.parametrize("name", ALL)
def test_problems_without_a_point_are_proved_to_be_so(name: str) -> None:
    rng = np.random.default_rng(6)
    A = rng.standard_normal((8, 5))
    lam = rng.uniform(0.5, 1.0, 8)
    A[7] = -(lam[:7] @ A[:7]) / lam[7]
    rows = QP.build(np.eye(5), np.ones(5), A, np.ones(8))
    bounds = QP.build(np.eye(2), np.zeros(2), A=[[1.0, 1.0]], b=[3.0], ub=np.ones(2))
    equalities = QP.build(np.eye(2), np.zeros(2), C=[[1.0, 1.0], [2.0, 2.0]], d=[1.0, 3.0])
    for problem in (rows, bounds, equalities):
        output = solvers.get(name).run(problem)
        assert output.claim is not Claim.SOLVED
        if name in ACTIVE or (name == "interior-point-qp" and problem is not equalities):
            assert output.claim is Claim.INFEASIBLE, output.message
            assert "to rounding" in output.message
            assert problem.certifies_infeasibility(output.certificate)
            assert not problem.certifies_infeasibility(-output.certificate)


@pytest.mark.parametrize("name", CONVEX)
def test_unbounded_problems_are_proved_to_be_so(name: str) -> None:
    Q = np.diag([1.0, 0.0])
    for problem in (
        QP.build(Q, [0.0, -1.0], lb=np.zeros(2)),
        QP.build(Q, [0.0, -1.0], A=[[-1.0, 1.0]], b=[0.0]),
        QP.build(np.zeros((2, 2)), [1.0, -2.0], C=[[1.0, -1.0]], d=[0.0]),
    ):
        output = solvers.get(name).run(problem)
        assert output.claim is Claim.UNBOUNDED, (name, output.claim, output.message)


def test_a_proof_of_infeasibility_must_hold() -> None:
    problem = QP.build(np.eye(2), np.zeros(2), A=[[1.0, 0.0], [-1.0, 0.0]], b=[1.0, 1.0])
    none = np.zeros(0)
    assert infeasibility(problem, np.array([1.0, 1.0]), none) == pytest.approx(2.0)
    assert infeasibility(problem, np.array([1.0, 0.9]), none) is None
    assert infeasibility(problem, np.zeros(2), none) is None
    feasible = QP.build(np.eye(2), np.zeros(2), A=[[1.0, 0.0], [-1.0, 0.0]], b=[1.0, -1.0])
    assert infeasibility(feasible, np.array([1.0, 1.0]), none) is None


def test_a_bound_times_rounding_proves_nothing() -> None:
    """z ≥ −1e20 with ν = 1e-17: the product would be as large as the data, and the rows have a solution."""
    A = np.array([[0.1 + 0.2], [-0.3]])
    problem = QP.build(np.eye(1), np.zeros(1), A, b=[-1.0, -1.0], lb=[-1e20], ub=[-1e19])
    assert not problem.certifies_infeasibility(np.array([1.0, 1.0]))


def test_a_proof_of_unboundedness_must_hold() -> None:
    problem = QP.build(np.diag([1.0, 0.0]), [0.0, -1.0], lb=[-np.inf, 0.0])
    assert unboundedness(problem, np.array([0.0, 3.0])) == pytest.approx(-1.0)
    assert unboundedness(problem, np.array([1.0, 3.0])) is None
    assert unboundedness(problem, np.array([0.0, -3.0])) is None


def test_a_singular_q_is_refused() -> None:
    problem = planted.qp(np.random.default_rng(2), 8, 5, 0, "singular semidefinite")[0]
    assert "singular" in (solvers.get("dual-active-set").obstacle(problem) or "")


@pytest.mark.parametrize("name", ALL)
def test_what_is_not_convex_is_refused(name: str) -> None:
    problem = QP.build(np.diag([1.0, -1.0]), np.zeros(2), lb=-np.ones(2), ub=np.ones(2))
    assert "not convex" in (solvers.get(name).obstacle(problem) or "")


# ------------------------------------------------------------------------------------ kernels and references


def test_the_compiled_error_is_that_of_the_formulation() -> None:
    rng = np.random.default_rng(4)
    for scale in (1e-3, 1.0, 1e3):
        problem, point = planted.qp(rng, 9, 7, 2)
        for noise in (0.0, 1e-8, 1e-3):
            parts = tuple(scale * v + noise * rng.standard_normal(v.size) for v in point.arrays().values())
            expected = problem.residuals(type(point)(*parts)).error
            assert ErrorMeasure(problem).error(parts) == pytest.approx(expected, rel=1e-6, abs=1e-14)
    assert ErrorMeasure(problem).error((parts[0] * np.nan, *parts[1:])) == np.inf


def test_the_compiled_equilibration_is_that_of_numpy() -> None:
    rng = np.random.default_rng(5)
    unit = 10.0 ** rng.integers(-4, 5, 8)
    Q, A = planted.square(rng, 8, "positive definite") * np.outer(unit, unit), rng.standard_normal((5, 8)) * unit
    A[2] = 0.0
    problem = QP.build(Q, np.ones(8), A, -np.ones(5))
    one = scaled(problem)
    other = scaled(QP.build(sp.csr_array(Q), np.ones(8), sp.csr_array(A), -np.ones(5)), keep_sparse=True)
    np.testing.assert_array_equal(one.D, other.D)
    np.testing.assert_array_equal(one.E, other.E)
    np.testing.assert_allclose(one.H, other.H.toarray())
    assert 0.1 < np.abs(np.vstack([one.H / one.c, one.G])).max() <= 4.0


def test_the_sparse_factor_is_ldl() -> None:
    kernel = qp_ldl
    rng = np.random.default_rng(8)
    S = sp.random_array((30, 30), density=0.1, rng=rng)
    K = sp.csc_array(S + S.T + sp.diags_array(np.where(np.arange(30) < 20, 8.0, -8.0)))
    upper = sp.csc_array(sp.triu(K, 1))
    indptr, indices = upper.indptr.astype(np.int32), upper.indices.astype(np.int32)
    parent, count = np.empty((2, 30), dtype=np.int64)
    kernel.tree(indptr, indices, parent, count)
    for tail in (30, 12):
        starts = np.concatenate([[0], np.cumsum(count[:tail])])
        rows, L, D = np.empty(starts[-1], dtype=np.uint32), np.empty(starts[-1]), np.empty(tail)
        rest = np.zeros((30 - tail, 30 - tail))
        matrix = indptr, indices, upper.data, K.diagonal()
        assert kernel.factor(*matrix, parent, starts, rows, L, D, rest, tail)
        lower = np.eye(30)
        lower[rows, np.repeat(np.arange(tail), count[:tail])] = L
        middle = np.diag(np.r_[D, np.zeros(30 - tail)])
        middle[tail:, tail:] = np.tril(rest) + np.tril(rest, -1).T
        np.testing.assert_allclose(lower @ middle @ lower.T, K.toarray(), atol=1e-12)


@pytest.mark.parametrize("n", [1, 5, 130])
def test_the_dense_factor_is_ldl(n: int) -> None:
    """Quasi-definite: by the inertia of [[P, Bᵀ], [B, −R]], and the matrix is made again of its factors."""
    kernel = qp_ldl
    rng = np.random.default_rng(n)
    K = rng.standard_normal((n, n))
    K = K + K.T
    K[np.diag_indices(n)] += np.where(np.arange(n) < n // 2, 1.0, -1.0) * 4 * n
    S, b = np.ascontiguousarray(np.tril(K)), rng.standard_normal(n)
    assert kernel.dense_factor(S, K.diagonal().copy())
    lower = np.tril(S, -1) + np.eye(n)
    np.testing.assert_allclose(lower @ np.diag(S.diagonal()) @ lower.T, K, atol=1e-11 * n)
    x = b.copy()
    kernel.dense_solve(S, x)
    np.testing.assert_allclose(K @ x, b, atol=1e-11)


def test_minimum_degree_is_an_order_with_little_fill() -> None:
    """No fill on a tree and where few rows join all unknowns; on a square grid of 30² no more than 1.2 times that of
    SuperLU's multiple minimum degree."""
    kernel = minimum_degree
    line = sp.diags_array([1.0, 1.0], offsets=[-1, 1], shape=(30, 30))
    rng = np.random.default_rng(0)
    parents = [int(rng.integers(0, i)) for i in range(1, 200)]
    tree = sp.coo_array((np.ones(199), (np.arange(1, 200), parents)), shape=(200, 200))
    grid = sp.kron(line, sp.eye_array(30)) + sp.kron(sp.eye_array(30), line)
    joined = sp.csr_array(np.ones((8, 400)))  # 8 rows that all of 400 unknowns are in: these first, without fill
    joined = sp.block_array([[None, joined.T], [joined, None]])
    full = sp.csr_array(np.ones((40, 40)) - np.eye(40))
    cases = (tree + tree.T, 199), (grid, 1.2 * 10_200), (joined, 8 * 400 + 28), (full, 40 * 39 // 2)
    for pattern, most in [(sp.csr_array(matrix), most) for matrix, most in cases]:
        order = np.empty(pattern.shape[0], dtype=np.int64)
        kernel.minimum_degree(pattern.indptr.astype(np.int32), pattern.indices.astype(np.int32), order)
        assert (np.sort(order) == np.arange(order.size)).all()
        upper = sp.csc_array(sp.triu(pattern[order][:, order]))
        parent, count = np.empty((2, order.size), dtype=np.int64)
        qp_ldl.tree(upper.indptr.astype(np.int32), upper.indices.astype(np.int32), parent, count)
        assert count.sum() <= most


def reducible() -> tuple[QP, Any]:
    """Every kind of reduction, around a planted solution with its multipliers: z_0 is fixed, row 0 of A bounds z_1 from
    below and row 1 of C fixes z_2, z_3 is in no row, z_4 is free and in one equation, z_5 free and in one inequality,
    rows 2 and 3 of A are multiples of each other, the second tighter, row 4 is empty."""
    Q = np.zeros((9, 9))
    Q[np.ix_([0, 1, 2, 6, 7], [0, 1, 2, 6, 7])] = planted.square(np.random.default_rng(2), 5, "positive definite")
    A, C = np.zeros((6, 9)), np.zeros((3, 9))
    A[0, 1], A[1, [5, 6]], A[2, [6, 7, 8]] = 2.0, [1.5, 1.0], [1.0, -1.0, 2.0]
    A[3], A[5, [0, 1, 7]] = 3.0 * A[2], [1.0, 2.0, 1.0]
    C[0, [4, 6, 0]], C[1, 2], C[2, [1, 7, 8]] = [2.0, 1.0, 1.0], -4.0, [1.0, 1.0, -1.0]
    z = np.array([1.0, 0.5, -2.0, 4.0, 0.3, -0.7, 1.1, -0.4, 0.9])
    lam, mu, nu = np.array([0.8, 0.6, 0.0, 0.5, 0.0, 0.0]), np.array([-0.7, 1.3, 0.4]), np.zeros(9)
    nu[[0, 3]] = -1.5, -2.0
    slack = np.where(lam > 0, 0.0, [0, 0, 1.0, 0, 2.0, 1.0])
    lb, ub = np.full(9, -np.inf), np.full(9, np.inf)
    lb[0], ub[[0, 3]], lb[3] = z[0], z[[0, 3]], -5.0
    problem = QP.build(Q, A.T @ lam + C.T @ mu + nu - Q @ z, A, A @ z - slack, C, C @ z, lb=lb, ub=ub)
    return problem, (z, lam, mu, nu)


def test_presolve_does_all_it_can_and_leads_back() -> None:
    problem, planted_answer = reducible()
    assert problem.residuals(QPPoint(*planted_answer)).error <= 1e-14
    data = sparse_data(problem)
    found = presolved(data)
    assert found is not None
    left, lift = found
    assert (left.p.size, left.b.size, left.d.size) == (4, 2, 1)
    matrix = [sp.csr_array((M[2], M[1], M[0]), shape=(M[0].size - 1, 4)).toarray() for M in (left.Q, left.G)]
    reduced = QP.build(matrix[0], left.p, matrix[1][:2], left.b, matrix[1][2:], left.d, left.lb, left.ub)
    point = solved("proximal-active-set", reduced, 1e-9).point
    answer = lift((point.z, point.lam, point.mu, point.nu))
    assert problem.residuals(QPPoint(*answer)).error <= 1e-9
    for ours, theirs in zip(answer, planted_answer, strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-7)


@pytest.mark.parametrize("seed", range(30))
def test_presolved_answers_are_those_of_the_whole(seed: int) -> None:
    """Sparse problems of small numbers, so that everything happens; as the active set has the objective."""
    rng = np.random.default_rng(seed)
    n, m, k = 12, 10, 3
    Q = np.diag(np.where(rng.random(n) < 0.5, rng.integers(1, 4, n), 0).astype(float))
    A = rng.integers(-1, 2, (m, n)) * (rng.random((m, n)) < rng.uniform(0.08, 0.25))
    C = rng.integers(-1, 2, (k, n)) * (rng.random((k, n)) < 0.2)
    A[-2:] = 2 * A[:2]
    z = rng.integers(-2, 3, n).astype(float)
    lb = np.where(rng.random(n) < 0.4, z - rng.integers(0, 2, n), -np.inf)
    ub = np.where(rng.random(n) < 0.4, z + rng.integers(0, 2, n), np.inf)
    lam, slack = np.where(rng.random(m) < 0.5, rng.random(m), 0.0), rng.integers(0, 2, m)
    slack = np.where(lam > 0, 0, slack)
    nu = np.where(z == lb, rng.random(n), 0.0) - np.where(z == ub, rng.random(n), 0.0)
    A, C = A.astype(float), C.astype(float)
    p = A.T @ lam + C.T @ rng.standard_normal(k) + nu - Q @ z
    problem = QP.build(Q, p, A, A @ z - slack, C, C @ z, lb=lb, ub=ub)
    output = solved("interior-point-qp", problem, 1e-6)
    assert problem.objective(output.point.z) == pytest.approx(problem.objective(z), rel=1e-5, abs=1e-5)
    assert presolved(sparse_data(problem)) is not None


def small(problem: QP) -> Any:
    """What one compiled call finds, None where it ends without."""
    return in_one_call(problem, 1e-9, ProximalActiveSetOptions())


def test_one_compiled_call_tells_what_is_not_convex_and_leaves_the_rest() -> None:
    """An indefinite Q, a zero row beside one that is not, a program without a point, one without a bound."""
    for Q in ([[1.0, 0.0], [0.0, -1.0]], [[1.0, 1.0], [1.0, 0.0]], [[1.0, 2.0], [2.0, 1.0]]):
        output = small(QP.build(np.array(Q), np.ones(2), lb=np.zeros(2), ub=np.ones(2)))
        assert output is not None
        assert output.claim is Claim.FAILED
    assert small(QP.build(np.eye(1), np.ones(1), -np.eye(1), np.ones(1), lb=np.zeros(1))) is None
    assert small(QP.build(np.zeros((1, 1)), np.ones(1))) is None


def radial(n: int, seed: int, ridge: float) -> QP:
    """The dual of a support vector machine on points in the plane, whose Q is singular to rounding but for a ridge."""
    rng = np.random.default_rng(seed)
    x, y = rng.standard_normal((n, 2)), rng.choice([-1.0, 1.0], n)
    Q = y[:, None] * np.exp(-0.5 * ((x[:, None] - x) ** 2).sum(2)) * y + ridge * np.eye(n)
    return QP.build(Q, -np.ones(n), C=y[None], d=np.zeros(1), lb=np.zeros(n), ub=np.full(n, 10.0))


@pytest.mark.parametrize("n", [60, 80, 100])
def test_proximal_steps_are_taken_where_half_of_the_digits_would_be_lost(n: int) -> None:
    """Without them passes undo each other, and the call ends without an answer."""
    for seed in range(3):
        output = in_one_call(radial(n, seed, 1e-11), 1e-8, ProximalActiveSetOptions())
        assert output is not None, seed
        assert output.claim is Claim.SOLVED
        assert output.counters["proximal_steps"] > 1
        assert output.counters["iterations"] <= 3 * n


def test_a_limit_of_passes_ends_one_compiled_call_with_its_best_answer() -> None:
    problem = radial(60, 0, 1e-3)
    whole = in_one_call(problem, 1e-8, ProximalActiveSetOptions())
    assert whole is not None
    passes = whole.counters["iterations"] - whole.counters["proximal_steps"]
    assert passes > 4
    cut = in_one_call(problem, 1e-8, ProximalActiveSetOptions(), passes // 2)
    assert cut is not None
    assert cut.claim is Claim.MAX_ITER
    assert cut.counters["iterations"] <= passes // 2 + 1
    error = problem.residuals(cut.point).error
    assert 1e-8 < error < np.inf
    assert f"{error:.1e}" in cut.message
    again = in_one_call(problem, 1e-8, ProximalActiveSetOptions(), passes)
    assert again is not None
    assert again.claim is Claim.SOLVED


def test_dense_data_are_for_the_active_set_until_the_interior_point_would_be_done(monkeypatch: Any) -> None:
    """Which takes over then; sparse data are for it at once."""
    solver, b = solvers.get("auto-qp"), Budget(tolerance=1e-6)
    fit = np.random.default_rng(0).standard_normal((300, 150))
    quick = QP.build(fit.T @ fit, fit.T @ np.ones(300), lb=np.zeros(150), A=np.ones((1, 150)), b=np.zeros(1))
    assert solver.run(quick, b).message == "proximal-active-set: solved"
    assert solver.phases(banded(150, np.random.default_rng(0)))[0].solver == "interior-point-qp"
    monkeypatch.setattr("cpbench_solvers.qp.auto.TURNS", 0)
    assert solver.phases(quick)[0].iterations == 1
    assert "after 1 passes; interior-point-qp: solved" in solver.run(quick, b).message


@pytest.mark.parametrize(("n", "sparse", "first"), [(40, False, 0), (80, False, 1), (80, True, 2), (150, False, 2)])
def test_where_bounds_alone_hold_it_steps_on_faces_come_before_the_interior_point(
    n: int, sparse: bool, first: int
) -> None:
    """After the active set on full matrices of up to 100 unknowns, and in place of it on others: a wrong bound is left
    by a step on its face, while the active set takes a pass for each. The answer is planted."""
    rng, held = np.random.default_rng(n), np.arange(n) % 2 == 0
    B = np.eye(n) + (np.diag(np.full(n - 1, 0.5), 1) if sparse else 0.3 * rng.standard_normal((n, n)))
    z, Q = np.where(held, 0.0, rng.uniform(1.0, 2.0, n)), B.T @ B
    p = np.where(held, 1.0, 0.0) - Q @ z
    problem = QP.build(sp.csr_array(Q) if sparse else Q, p, lb=np.zeros(n))
    solver, names = solvers.get("auto-qp"), ("proximal-active-set", "mprgp-qp", "interior-point-qp")
    order = tuple(phase.solver for phase in solver.phases(problem))
    assert order[:2] == (names[::2], names[:2], names[1:])[first]
    output = solver.run(problem, Budget(tolerance=1e-8))
    np.testing.assert_allclose(output.point.z, z, atol=1e-6)


@pytest.mark.parametrize(
    ("n", "sparse", "held", "limit"),
    [(120, False, 90, None), (120, False, 102, 96), (80, True, 18, None), (80, True, 24, 20)],
)
def test_where_many_unknowns_will_be_held_the_interior_point_is_first(
    n: int, sparse: bool, held: int, limit: int | None
) -> None:
    """Of n unknowns z ≥ 0, `held` are negative at the minimum without bounds: with more than `limit` of them, 0.8 n or,
    where matrices are sparse, 0.25 n."""
    aim = np.ones(n)
    aim[:held] = -1.0
    Q = sp.csr_array(sp.diags_array(np.linspace(1.0, 2.0, n))) if sparse else np.eye(n) + 1e-3
    problem = QP.build(Q, -Q @ aim, lb=np.zeros(n), A=sp.csr_array(np.eye(1, n) + np.eye(1, n, 1)), b=np.full(1, -9.0))
    output = solvers.get("auto-qp").run(problem, Budget(tolerance=1e-6))
    assert output.claim is Claim.SOLVED
    assert output.message.startswith("proximal-active-set: " + ("solved" if limit is None else f"more than {limit} "))


def test_what_presolve_leaves_without_a_solution_is_proved_on_the_whole() -> None:
    """A row of one unknown goes, all unknowns stay; two rows contradict each other, or nothing bounds the cost."""
    A, bounds = np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 1.0], [-1.0, -1.0, -1.0]]), (np.zeros(3), np.full(3, 50.0))
    problem = QP.build(np.eye(3), np.ones(3), A, [0.5, 2.0, -1.0], None, None, *bounds)
    assert presolved(sparse_data(problem)) is not None
    assert solvers.get("interior-point-qp").run(problem).claim is Claim.INFEASIBLE
    free = QP.build(np.zeros((3, 3)), -np.ones(3), A[:2], [0.5, 2.0], lb=np.zeros(3))
    assert presolved(sparse_data(free)) is not None
    assert solvers.get("interior-point-qp").run(free).claim is Claim.UNBOUNDED


def rendezvous(steps: int, duration: float = 1000.0) -> QP:
    """A point comes to rest at a place with least thrust, each of three thrusts up to 1, by the trapezoidal rule: of
    the kind of UBH1 of CUTEst."""
    T, half = steps + 1, 0.5 * duration / steps
    D = sp.diags_array([-1.0, 1.0], offsets=[0, 1], shape=(steps, T))
    M = sp.diags_array([half, half], offsets=[0, 1], shape=(steps, T))
    C = sp.kron(sp.block_array([[D, -M, None], [None, D, -M]]), sp.eye_array(3)).tocsr()
    lb, ub = np.full(9 * T, -np.inf), np.full(9 * T, np.inf)
    lb[6 * T :], ub[6 * T :] = -1.0, 1.0
    ends = (0, 1000.0), (3 * steps, 10.0), (3 * T, -10.0), (3 * (T + steps), 0.0)
    for at, value in ends:
        lb[at : at + 3] = ub[at : at + 3] = value
    Q = sp.diags_array(np.r_[np.zeros(6 * T), np.ones(3 * T)]).tocsr()
    return QP.build(Q, np.zeros(9 * T), C=C, d=np.zeros(6 * steps), lb=lb, ub=ub)


def test_the_interior_point_goes_on_where_more_regularization_does_not_help() -> None:
    """The last right-hand sides are rounding of much larger iterates: what a linear system leaves of them is not
    small, whatever is added to its diagonal."""
    problem = rendezvous(500)
    output = solved("interior-point-qp", problem)
    assert output.counters["iterations"] <= 20


def dependent(seed: int) -> tuple[QP, Any]:
    """A third of the equations are sums of the others, up to rounding of unknowns of size 1e4; the planted z beside
    it. Those of z that are positive leave yet other equations dependent, so that dropping a third is not enough."""
    rng = np.random.default_rng(seed)
    m, n = 40, 100
    own = np.where(rng.random((m, n)) < 0.1, rng.standard_normal((m, n)), 0.0)
    C = sp.csr_array(np.vstack([own, rng.standard_normal((m // 2, m)) @ own]))
    z = np.where(rng.random(n) < 0.5, 1e4 * rng.random(n) + 0.1, 0.0)
    nu = np.where(z > 0.0, 0.0, rng.random(n) + 0.1)
    Q = sp.diags_array(np.where(rng.random(n) < 0.2, rng.random(n), 0.0)).tocsr()
    p = C.T @ rng.standard_normal(C.shape[0]) + nu - Q @ z
    return QP.build(Q, p, C=C, d=C @ z, lb=np.zeros(n)), z


@pytest.mark.parametrize("seeds", [range(12), pytest.param(range(12, 200), marks=pytest.mark.nightly)])
def test_equations_that_depend_on_others_are_no_obstacle(seeds: range) -> None:
    """Whatever the rounding: `.ci/arithmetics` repeats this under others. Multipliers do not drift, so that few
    iterations are enough."""
    for seed in seeds:
        problem, z = dependent(seed)
        output = solved("interior-point-qp", problem)
        assert output.counters["iterations"] <= 30, seed
        assert problem.objective(output.point.z) == pytest.approx(problem.objective(z), rel=1e-5), seed


@pytest.mark.parametrize("name", ["auto-qp", "proximal-active-set", "interior-point-qp", "augmented-lagrangian"])
@pytest.mark.parametrize("unit", [1.0, 1e-6])
def test_prices_in_small_units_are_no_excuse(name: str, unit: float) -> None:
    """By hand: Q has rank 1 and z₁ is at its bound 0.03, so that 4z₂ = 5 + 6z₁; absolute forces of 5e-7 miss that by
    10⁻⁵ and are 3e-4 of the terms."""
    Q, p = unit * np.array([[9.0, -6.0], [-6.0, 4.0]]), unit * np.array([9.0, -5.0])
    problem = QP.build(1e-4 * Q, 1e-4 * p, A=[[1.0, 0.0], [1.0, 0.0]], b=[0.0, 0.0], lb=[0.03, 0.0])
    output = solvers.get(name).run(problem, Budget(tolerance=1e-6))
    assert output.claim is Claim.SOLVED
    assert judge(problem, output.point, 1e-6).solved
    assert output.point.z == pytest.approx([0.03, 1.295], abs=1e-5)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("name", ["QSCRS8", "QSIERRA"])
def test_the_path_goes_on_where_products_are_small_and_the_error_is_not(
    shared_data: Path, name: str, tolerance: float
) -> None:
    """The error of these answers is ten thousand times their tᵀz over its size."""
    problem = storage.load(shared_data / "qp" / f"{name}.mat")
    output = solvers.get("interior-point-qp").run(problem, Budget(tolerance=tolerance))
    assert output.claim is Claim.SOLVED
    assert judge(problem, output.point, tolerance).solved


@pytest.mark.parametrize("unit", [1e-24, 1e24])
def test_the_unit_of_an_objective_makes_no_difference(unit: float) -> None:
    """½(z₁ - z₂)² + ½10⁻¹⁰(z₁² + z₂²) - z₁ + 0.9 z₂ over [-4, 4]² beside 5 z₃²: z₁ = 4, z₂ = 3.1/(1 + 10⁻¹⁰)."""
    Q = np.zeros((3, 3))
    Q[:2, :2] = unit * (np.array([[1.0, -1.0], [-1.0, 1.0]]) + 1e-10 * np.eye(2))
    Q[2, 2] = 10.0
    p = np.array([-unit, 0.9 * unit, 0.0])
    problem = QP.build(Q, p, lb=np.array([-4.0, -4.0, 0.0]), ub=np.full(3, 4.0))
    output = solvers.get("auto-qp").run(problem, Budget(tolerance=1e-6))
    assert output.claim is Claim.SOLVED
    np.testing.assert_allclose(output.point.z, [4.0, 3.1 / (1.0 + 1e-10), 0.0], atol=1e-5)
