"""Splitting, projection and Newton on LCPs and bounds: kernels against plain NumPy, planted and degenerate problems."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench.formulations import LCP
from cpbench.solvers import Budget, Claim, solvers
from cpbench.testing import planted
from cpbench.verification import judge


def poisson(m: int) -> sp.csr_array:
    """Five-point Laplacian on m × m points of the unit square."""
    T = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(m, m))
    one = sp.eye_array(m)
    return sp.csr_array((sp.kron(T, one) + sp.kron(one, T)) * (m + 1) ** 2)


def membrane(m: int) -> LCP:
    """An elastic membrane on a plane, one half of it pushed down and the other pulled up: z is the gap."""
    return LCP(M=poisson(m), q=np.where(np.arange(m * m) % m < m // 2, 8.0, -8.0))


def reference_ssor(M: np.ndarray, q: np.ndarray, omega: float, sweeps: int) -> np.ndarray:
    """Projected over-relaxation, forth and back."""
    z = np.zeros(q.size)
    for _ in range(sweeps):
        for i in [*range(q.size), *reversed(range(q.size))]:
            z[i] = max(0.0, z[i] - omega * (M[i] @ z + q[i]) / M[i, i])
    return z


@pytest.mark.parametrize("sparse", [False, True])
def test_symmetric_sweeps_are_those_of_plain_numpy(rng: np.random.Generator, sparse: bool) -> None:
    M = planted.square(rng, 12, "positive definite")
    q = rng.standard_normal(12)
    problem = LCP(M=sp.csr_array(M) if sparse else M, q=q)
    solver = solvers.get("ssor")
    output = solver.run(problem, Budget(tolerance=1e-16, iterations=7), solver.spec.options(omega=1.2))
    np.testing.assert_allclose(output.point.z, reference_ssor(M, q, 1.2, 7), rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("solver", ["pgs", "psor", "ssor", "block-gs"])
def test_splittings_solve_a_membrane(solver: str) -> None:
    problem = membrane(12)
    output = solvers.get(solver).run(problem, Budget(tolerance=1e-9))
    assert output.claim is Claim.SOLVED
    assert judge(problem, output.point, 1e-9).solved


@pytest.mark.parametrize("limit", [1, 255, 256, 257])
def test_a_limit_of_sweeps_is_kept_however_it_lies_to_the_chunks(limit: int) -> None:
    output = solvers.get("pgs").run(membrane(30), Budget(tolerance=1e-14, iterations=limit))
    assert output.claim is Claim.MAX_ITER
    assert output.counters["iterations"] == limit


def reference_block_gs(M: np.ndarray, q: np.ndarray, size: int, omega: float, sweeps: int) -> np.ndarray:
    """Blocks solved by the registered solver of Lemke's method."""
    z = np.zeros(q.size)
    for _ in range(sweeps):
        for first in range(0, q.size, size):
            B = slice(first, first + size)
            local = LCP(M=M[B, B], q=M[B] @ z + q[B] - M[B, B] @ z[B])
            new = solvers.get("lemke").run(local, Budget(tolerance=1e-12)).point.z
            z[B] = np.maximum(0.0, z[B] + omega * (new - z[B]))
    return z


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize(("size", "omega"), [(1, 1.0), (4, 1.0), (5, 1.2), (13, 1.0), (64, 1.0)])
def test_sweeps_by_blocks_are_those_of_plain_numpy(
    rng: np.random.Generator, sparse: bool, size: int, omega: float
) -> None:
    M = planted.square(rng, 13, "positive definite")
    q = rng.standard_normal(13)
    problem = LCP(M=sp.csr_array(M) if sparse else M, q=q)
    solver = solvers.get("block-gs")
    options = solver.spec.options(block=size, omega=omega)
    output = solver.run(problem, Budget(tolerance=1e-16, iterations=3), options)
    np.testing.assert_allclose(output.point.z, reference_block_gs(M, q, size, omega, 3), rtol=1e-9, atol=1e-12)


def test_one_block_is_enough_where_it_holds_everything() -> None:
    problem, _ = planted.lcp(np.random.default_rng(1), 20, "monotone")
    solver = solvers.get("block-gs")
    output = solver.run(problem, Budget(tolerance=1e-9), solver.spec.options(block=20))
    assert output.claim is Claim.SOLVED
    assert output.counters["iterations"] <= 2


def test_blocks_may_have_zeros_in_their_diagonals() -> None:
    """Facets of two contacts that hardly feel each other: rows (r_N, beta, lambda), M_lambda,lambda = 0."""
    contact = np.array([[2.0, 0.5, -0.5, 0], [0.5, 1, -1, 1], [-0.5, -1, 1, 1], [0.3, -1, -1, 0]])
    M = np.kron(np.eye(2), contact) + 0.02 * np.kron(1 - np.eye(2), contact * np.outer([1, 1, 1, 0], [1, 1, 1, 0]))
    problem = LCP(M=M, q=np.array([-1.0, 0.7, -0.7, 0.0, -2.0, -0.1, 0.1, 0.0]))
    solver = solvers.get("block-gs")
    output = solver.run(problem, Budget(tolerance=1e-10), solver.spec.options(block=4))
    assert output.claim is Claim.SOLVED, output.message
    assert judge(problem, output.point, 1e-10).solved
    assert solvers.get("pgs").obstacle(problem)


def test_a_block_without_solution_is_said_as_a_stall() -> None:
    """M = 0, q < 0: no block has a solution, nothing moves."""
    output = solvers.get("block-gs").run(LCP(M=np.zeros((3, 3)), q=-np.ones(3)))
    assert output.claim is Claim.FAILED
    assert "stalled" in output.message
