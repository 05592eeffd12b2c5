"""Principal pivoting: the tableau against block elimination, Murty's rule, changing bases, and enumeration."""

from __future__ import annotations

import numpy as np
import planted
import pytest

from cpbench.formulations import LCP
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_problems.generators.lcp_classics import csizmadia, isolated_perturbed, murty, unbounded_ray
from cpbench_solvers.kernels import lemke_pairs, principal_pivoting
from cpbench_solvers.lcp.changing_basis import ChangingBasis
from cpbench_solvers.lcp.principal_pivoting import transform


def reference_transform(M: np.ndarray, q: np.ndarray, F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The principal transform on F by its definition: [[A⁻¹, -A⁻¹B], [CA⁻¹, D - CA⁻¹B]] (Cottle, Pang, Stone, 2.3)."""
    N = np.setdiff1d(np.arange(q.size), F)
    A, B, C, D = M[np.ix_(F, F)], M[np.ix_(F, N)], M[np.ix_(N, F)], M[np.ix_(N, N)]
    inverse = np.linalg.inv(A)
    T, y = np.zeros_like(M), np.zeros_like(q)
    T[np.ix_(F, F)], T[np.ix_(F, N)] = inverse, -inverse @ B
    T[np.ix_(N, F)], T[np.ix_(N, N)] = C @ inverse, D - C @ inverse @ B
    y[F], y[N] = -inverse @ q[F], q[N] - C @ inverse @ q[F]
    return T, y


def reference_murty(M: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, int]:
    """z and pivots of the least-index rule, every basis solved afresh."""
    inside, pivots = np.zeros(q.size, dtype=bool), 0
    while True:
        F = np.flatnonzero(inside)
        z = np.zeros(q.size)
        z[F] = np.linalg.solve(M[np.ix_(F, F)], -q[F])
        value = np.where(inside, z, M @ z + q)
        negative = np.flatnonzero(value < -1e-12)
        if negative.size == 0:
            return z, pivots
        inside[negative[0]] ^= True
        pivots += 1


def test_pivots_make_the_principal_transform(rng: np.random.Generator) -> None:
    """One pair after the other, and all at once, against the definition."""
    kernel = principal_pivoting
    M, q, F = rng.standard_normal((7, 7)), rng.standard_normal(7), np.array([1, 3, 5])
    T = M.copy()
    for r in F:
        kernel.exchange(T, r, np.empty(7))
    expected, constant = reference_transform(M, q, F)
    np.testing.assert_allclose(T, expected, rtol=1e-9, atol=1e-12)
    block = transform(M, q, F)
    assert block is not None
    np.testing.assert_allclose(block.T, expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(block.y, constant, rtol=1e-9, atol=1e-12)
    assert transform(np.ones((3, 3)), np.ones(3), np.array([0, 1])) is None


@pytest.mark.parametrize("seed", range(5))
def test_murty_takes_the_pivots_of_his_rule(seed: int) -> None:
    problem, _ = planted.lcp(np.random.default_rng(seed), 25, "positive definite")
    z, pivots = reference_murty(np.array(problem.M), np.array(problem.q))
    output = solvers.get("murty").run(problem, Budget(tolerance=1e-10))
    assert output.counters["iterations"] == pivots
    np.testing.assert_allclose(output.point.z, z, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("n", [3, 9])
def test_murtys_own_problem_takes_every_basis(n: int) -> None:
    """2ⁿ - 1 pivots where the first component depends on all others (Murty 1978), one in the other order."""
    M = np.array(murty(n).problem.M)
    for matrix, pivots in ((M, 1), (M.T, 2**n - 1)):
        output = solvers.get("murty").run(LCP(M=matrix, q=-np.ones(n)))
        assert output.claim is Claim.SOLVED
        assert output.counters["iterations"] == pivots


def test_a_row_of_the_tableau_proves_that_there_is_no_solution() -> None:
    """w₁ = −1 whatever z is."""
    problem = LCP(M=np.array([[0.0, 0.0], [0.0, 1.0]]), q=np.array([-1.0, 1.0]))
    output = solvers.get("murty").run(problem)
    assert output.claim is Claim.INFEASIBLE
    assert problem.certifies_infeasibility(output.certificate)


def test_enumeration_on_problems_with_known_sets_of_solutions() -> None:
    """One, four, a ray of them, none with and without Farkas' proof, one of a P-matrix."""
    run = solvers.get("enumeration-lcp").run
    assert run(LCP(M=np.array([[0.0, 1.0], [1.0, 0.0]]), q=[-1.0, -1.0])).counters["solutions"] == 1
    assert run(LCP(M=-np.eye(2), q=[1.0, 1.0])).counters["solutions"] == 4
    ray = run(unbounded_ray().problem)
    assert ray.claim is Claim.SOLVED
    assert "may not be isolated" in ray.message
    none = run(isolated_perturbed().problem)
    assert none.claim is Claim.INFEASIBLE
    assert isolated_perturbed().problem.certifies_infeasibility(none.certificate)
    assert run(csizmadia(12).problem).counters["solutions"] == 1
    assert run(LCP(M=np.zeros((2, 2)), q=[0.0, 1.0])).counters["singular_bases"] == 1
    # z = (0, 1) is feasible, but w₂ = z₁ + z₂ + 1 > 0 makes z₂ = 0, and then w₁ = -z₁ - 1 < 0
    unsolvable = run(LCP(M=np.array([[-1.0, 1.0], [1.0, 1.0]]), q=[-1.0, 1.0]))
    assert unsolvable.claim is Claim.INFEASIBLE
    assert unsolvable.certificate is None
    assert "exhaustion" in unsolvable.message
    assert "2^n" in (solvers.get("enumeration-lcp").obstacle(murty(21).problem) or "")
    assert run(csizmadia(12).problem, Budget(iterations=5)).claim is Claim.MAX_ITER


@pytest.mark.parametrize("kind", ["positive definite", "monotone", "symmetric indefinite"])
def test_a_bordered_factor_solves_the_changed_basis(rng: np.random.Generator, kind: str) -> None:
    """Indices that come, go and come back, few at a time and many; against a solve from scratch."""
    n = 60
    M, q = planted.square(rng, n, kind), rng.standard_normal(n)
    M = np.ascontiguousarray(M)
    basis = ChangingBasis(M, np.ascontiguousarray(M.T), q, symmetric=bool((M == M.T).all()))
    inside = rng.random(n) < 0.8
    for changes in (0, 1, 2, 1, 3, 0, 40, 2):
        inside[rng.choice(n, changes, replace=False)] ^= True
        F = np.flatnonzero(inside)
        found = basis.solve(inside)
        assert found is not None
        z = np.zeros(n)
        z[F] = np.linalg.solve(M[np.ix_(F, F)], -q[F])
        np.testing.assert_allclose(found[0], z, rtol=1e-6, atol=1e-8 * np.abs(z).max())
        w = M @ z + q
        w[F] = 0.0
        np.testing.assert_allclose(found[1], w, rtol=1e-6, atol=1e-8 * np.abs(w).max())
    assert basis.factorizations < 8
    assert (
        ChangingBasis(np.ones((3, 3)), np.ones((3, 3)), np.array([1.0, 2.0, 0.0]), True).solve(np.ones(3, bool)) is None
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sweeps", [0, 20])
def test_block_pivoting_hands_over_to_lemke(seed: int, sweeps: int) -> None:
    """Semidefinite of rank 0.6 n: blocks cycle or meet singular bases; Lemke's method decides and both are said."""
    rng = np.random.default_rng(seed)
    H = rng.standard_normal((80, 48))
    problem = LCP(M=H @ H.T, q=H @ rng.standard_normal(48) + 0.05 * np.abs(rng.standard_normal(80)))
    solver = solvers.get("bpp")
    output = solver.run(problem, Budget(tolerance=1e-8), solver.spec.options(max_sweeps=sweeps))
    assert output.claim is Claim.SOLVED, output.message
    assert ("pivots" in output.counters) == ("Lemke" in output.message)
    alone = solver.run(problem, Budget(tolerance=1e-8), solver.spec.options(max_sweeps=sweeps, max_factorizations=0))
    assert alone.claim is Claim.SOLVED or "use lemke" in alone.message or alone.claim is Claim.MAX_ITER


def test_block_pivoting_ends_on_every_p_matrix() -> None:
    """Triangular up to an order, with diagonal 1: P-matrices on which blocks change in vain and Murty's rule ends."""
    solver, n = solvers.get("bpp"), 30
    alone = solver.spec.options(max_sweeps=1, max_factorizations=0)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        order = rng.permutation(n)
        M = (np.tril(rng.choice([-2.0, 2.0], size=(n, n)), -1) + np.eye(n))[np.ix_(order, order)]
        z = np.maximum(rng.standard_normal(n), 0.0)
        output = solver.run(LCP(M=M, q=np.where(z > 0, 0.0, rng.uniform(size=n)) - M @ z), options=alone)
        assert output.claim is Claim.SOLVED, f"seed {seed}: {output.message}"


@pytest.mark.parametrize("sweeps", [0, 2, 20])
def test_block_pivoting_from_any_guess(sweeps: int) -> None:
    """Sweeps that diverge, converge by themselves, or are left out: the answer of a P-matrix is the same."""
    rng = np.random.default_rng(7)
    n = 70
    A, B = rng.standard_normal((2, n, n))
    solver = solvers.get("bpp")
    for M in (A @ A.T / n + 0.1 * np.eye(n) + (B - B.T), A @ A.T / n + np.eye(n), np.array(csizmadia(12).problem.M)):
        problem = LCP(M=M, q=rng.standard_normal(len(M)))
        output = solver.run(problem, Budget(tolerance=1e-9), solver.spec.options(max_sweeps=sweeps))
        assert output.claim is Claim.SOLVED, output.message
        assert output.counters["sweeps"] >= min(sweeps, 1)
        warm = solver.run(problem, Budget(tolerance=1e-9), start=output.point)
        assert warm.claim is Claim.SOLVED
        assert warm.counters["iterations"] == 0


def test_the_transform_of_a_pair_is_its_definition(rng: np.random.Generator) -> None:
    kernel = lemke_pairs
    n = 7
    for _ in range(30):
        M, q = rng.uniform(-1, 1, (n, n)), rng.uniform(-1, 1, n)
        r, i = (int(k) for k in rng.choice(n, 2, replace=False))
        T, t, row, column = np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n)
        assert kernel.transform(M, q, r, i, T, t, row, column)
        expected, constant = reference_transform(M, q, np.sort([r, i]))
        np.testing.assert_allclose(T * row[:, None] / column, expected, rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(t * row, constant, rtol=1e-9, atol=1e-11)


def test_a_singular_pair_has_no_transform() -> None:
    kernel = lemke_pairs
    M = np.array([[0.1, 0.3, 1.0], [0.2, 0.6, 0.0], [1.0, 0.0, 1.0]])
    assert not kernel.transform(M, np.ones(3), 0, 1, np.empty((3, 3)), *np.empty((3, 3)))


@pytest.mark.parametrize("n", [2, 9, 40])
def test_games_are_solved_from_pairs_in_one_call(n: int) -> None:
    """Where nothing blocks the first pivot, as in bimatrix games, no run from w = q with larger pivots is tried."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        A, B = rng.uniform(1, 2, (2, n, n))
        M = np.block([[np.zeros((n, n)), A], [B.T, np.zeros((n, n))]])
        problem = LCP(M=M, q=np.full(2 * n, -1.0))
        output = solvers.get("lemke").run(problem, Budget(tolerance=1e-8))
        assert output.claim is Claim.SOLVED, seed
        assert judge(problem, output.point, 1e-8).solved, seed
