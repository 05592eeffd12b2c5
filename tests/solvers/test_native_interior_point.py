"""The interior point method on LCPs and MLCPs: planted problems, sparse and dense, degenerate ones, published ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import planted
import pytest
import scipy.sparse as sp

from cpbench import storage
from cpbench.formulations import LCP, MLCP, LCPPoint
from cpbench.foundation.matrices import dense as dense_array
from cpbench.solvers import Budget, Claim, solvers
from cpbench_solvers.lcp.interior_point_system import ShiftedSystem


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("free", [0, 3])
@pytest.mark.parametrize("kind", ["positive definite", "monotone"])
def test_the_shifted_system_is_solved(rng: np.random.Generator, sparse: bool, free: int, kind: str) -> None:
    """Cholesky, LU, SuperLU: the same as NumPy's."""
    K, theta, b = planted.square(rng, 9, kind), 10.0 ** rng.uniform(-9, 9, 9 - free), rng.standard_normal(9)
    system = ShiftedSystem(sp.csr_array(K) if sparse else K, free)
    for shift in (theta, 1.0 / theta):
        assert system.factor(shift)
        whole = K + np.diag(np.concatenate([np.zeros(free), shift]))
        x = system.solve(b)
        np.testing.assert_allclose(whole @ x, b, atol=1e-9 * max(1.0, abs(x).max()))


def test_a_singular_system_is_regularised() -> None:
    """A redundant equality: the right-hand side is in the range, and what comes out solves it."""
    K = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    system = ShiftedSystem(K, 2)
    assert system.factor(np.ones(1))
    x = system.solve(np.array([2.0, 2.0, 4.0]))
    np.testing.assert_allclose(K @ x + np.array([0, 0, x[2]]), [2.0, 2.0, 4.0], atol=1e-7)
    assert abs(x).max() < 1e6


def test_steps_hardly_depend_on_the_size() -> None:
    counts: list[int] = []
    for n in (20, 80, 320):
        problem, _ = planted.lcp(np.random.default_rng(n), n, "positive definite")
        counts.append(solvers.get("interior-point-lcp").run(problem, Budget(tolerance=1e-8)).counters["iterations"])
    assert max(counts) <= 30


def obstacle_problem(N: int) -> LCP:
    """A membrane on an N x N grid above a bump: Laplace's matrix of five points."""
    T = sp.diags_array([-np.ones(N - 1), 2.0 * np.ones(N), -np.ones(N - 1)], offsets=[-1, 0, 1])
    M = sp.csr_array(sp.kron(T, sp.eye_array(N)) + sp.kron(sp.eye_array(N), T))
    x = np.linspace(-1, 1, N)
    bump = np.maximum(0.0, 0.5 - x[:, None] ** 2 - x**2).ravel()
    return LCP(M=M, q=M @ bump + 0.01)


def test_sparse_lcps_have_the_answers_of_dense_ones() -> None:
    sparse = obstacle_problem(20)
    dense = LCP(M=dense_array(sparse.M), q=sparse.q)
    answers: list[Any] = [solvers.get("interior-point-lcp").run(p, Budget(tolerance=1e-9)) for p in (sparse, dense)]
    assert all(output.claim is Claim.SOLVED for output in answers)
    np.testing.assert_allclose(answers[0].point.z, answers[1].point.z, atol=1e-6)  # positive definite: one solution


@pytest.mark.parametrize("flat", [0, 40])
def test_sparse_optimality_conditions(flat: int) -> None:
    """B = 0 and, with `flat` unknowns without curvature, a singular A."""
    n, m = 300, 150
    rng = np.random.default_rng(flat)
    curvature = np.concatenate([np.zeros(flat), np.ones(n - flat)])
    A = sp.csr_array(sp.diags_array(curvature))
    columns = rng.permuted(np.tile(np.arange(n), (m, 1)), axis=1)[:, :3]
    columns[: min(flat, m), 0] = np.arange(min(flat, m))
    rows = np.repeat(np.arange(m), 3)
    D = sp.csr_array((rng.standard_normal(3 * m), (rows, columns.ravel())), shape=(m, n))
    u, (v, w) = rng.standard_normal(n), planted.complementary(rng, m)
    problem = MLCP(A=A, B=sp.csr_array((m, m)), C=sp.csr_array(-D.T), D=D, a=D.T @ v - A @ u, b=w - D @ u)
    output = solvers.get("interior-point-mlcp").run(problem, Budget(tolerance=1e-8))
    assert output.claim is Claim.SOLVED, output.message


def test_a_start_is_used() -> None:
    """From its own answer it ends at once, and from near by it takes fewer steps than from afar."""
    problem, _ = planted.lcp(np.random.default_rng(4), 80, "positive definite")
    solver = solvers.get("interior-point-lcp")
    cold = solver.run(problem, Budget(tolerance=1e-9))
    assert cold.point is not None
    assert solver.run(problem, Budget(tolerance=1e-9), start=cold.point).counters["iterations"] == 0
    near = LCPPoint(z=cold.point.z * (1.0 + 1e-5))
    assert solver.run(problem, Budget(tolerance=1e-9), start=near).counters["iterations"] < cold.counters["iterations"]


def test_every_file_of_siconos_to_eight_digits(shared_data: Path) -> None:
    """Newton's steps finish where degenerate pairs leave the interior ones at the root of rounding (deltasigma)."""
    for file in sorted((shared_data / "mlcp").glob("*.dat")):
        if file.stem != "Rectangular_mlcp":  # not square
            output = solvers.get("interior-point-mlcp").run(storage.load(file), Budget(tolerance=1e-8))
            assert output.claim is Claim.SOLVED, (file.stem, output.message)
