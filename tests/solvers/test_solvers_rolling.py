"""NSGS with rolling friction: its one-contact solve against an independent search, its sweep against plain NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np
import planted
import planted_contact
import pytest
import scipy.sparse as sp
from scipy.optimize import brentq
from tiers import some_by_day

from cpbench.formulations import FCPoint, FrictionContact, RollingFrictionContact
from cpbench.foundation import cones
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.kernels import rolling_gauss_seidel

SOLVER = "nsgs-rfc"


def one_contact(D: np.ndarray, q: np.ndarray, mu: float, mu_r: float) -> np.ndarray:
    """By cases: λ = ‖u_T‖/‖r_T‖ by Brent's method for a given κ = ‖ω‖/‖m‖, and κ by Brent's method around that."""
    d = q.size
    k = (d - 1) // 2
    if q[0] >= 0:
        return np.zeros(d)

    def at(lam: float, kap: float) -> np.ndarray:
        return np.linalg.solve(D + np.diag([0.0] + k * [lam] + k * [kap]), -q)

    def root(excess) -> float:
        """The first sign change from above; infinite where there is none."""
        if excess(0.0) <= 0:
            return 0.0
        top = 1.0
        while excess(top) > 0:
            top *= 4.0
            if top > 1e15:
                return np.inf
        return brentq(excess, 0.0, top, xtol=1e-15, rtol=1e-14)

    def slide(kap: float) -> float:
        return root(lambda lam: np.linalg.norm(at(lam, kap)[1 : 1 + k]) - mu * at(lam, kap)[0])

    def roll(kap: float) -> float:
        lam = slide(kap)  # none where r_N < 0 for every λ: then κ is too small
        return np.linalg.norm(at(lam, kap)[1 + k :]) - mu_r * at(lam, kap)[0] if lam < np.inf else 1.0

    kap = root(roll)
    return at(slide(kap), kap)


def block(rng: np.random.Generator, d: int, skew: float) -> np.ndarray:
    G, S = rng.standard_normal((2, d, d))
    D = G @ G.T + 0.5 * np.eye(d)
    # weak coupling of the normal with the rest keeps the one-contact problem uniquely solvable
    D[0, 1:] *= 0.15
    D[1:, 0] *= 0.15
    return D + skew * (S - S.T)


@pytest.mark.parametrize("d", some_by_day([3, 5], 2))
@pytest.mark.parametrize("skew", [0.0, 0.05])
def test_one_contact_is_solved_exactly(rng: np.random.Generator, d: int, skew: float) -> None:
    """All four of sticking or sliding with or without rolling occur."""
    seen = set()
    for _ in range(60):
        D, q = block(rng, d, skew), rng.standard_normal(d) * np.r_[1.0, np.full(d - 1, rng.choice([0.2, 3.0]))]
        mu, mu_r = rng.uniform(0.05, 2.0, 2)
        problem = RollingFrictionContact(W=D, q=q, mu=[mu], mu_r=[mu_r], dimension=d)
        output = solvers.get(SOLVER).run(problem, Budget(tolerance=1e-12, iterations=50))
        assert judge(problem, output.point, 1e-11).solved
        r = one_contact(D, q, mu, mu_r)
        np.testing.assert_allclose(output.point.r, r, rtol=1e-7, atol=1e-9)
        if r[0] > 0:
            t, m = (x[0] for x in cones.rolling_norms(r[None]))
            seen.add((bool(np.isclose(t, mu * r[0])), bool(np.isclose(m, mu_r * r[0]))))
    assert len(seen) == 4


def test_a_sweep_is_that_of_plain_numpy(rng: np.random.Generator) -> None:
    """Three sweeps over five contacts, every contact solved by `one_contact` with the others held."""
    nc, d = 5, 5
    G = 0.1 * rng.standard_normal((nc * d, nc * d))
    W = G @ G.T
    for c in range(nc):
        W[d * c : d * c + d, d * c : d * c + d] += block(rng, d, 0.0)
    q = rng.standard_normal(nc * d)
    q[::d] = -np.abs(q[::d])
    mu, mu_r = rng.uniform(0.1, 0.9, (2, nc))
    expected = np.zeros(nc * d)
    for _ in range(3):
        for c in range(nc):
            own = slice(d * c, d * c + d)
            v = q[own] + W[own] @ expected - W[own, own] @ expected[own]
            expected[own] = one_contact(W[own, own], v, mu[c], mu_r[c])
    problem = RollingFrictionContact(W=W, q=q, mu=mu, mu_r=mu_r, dimension=d)
    # the answer is the best iterate, which is the last one here
    output = solvers.get(SOLVER).run(problem, Budget(tolerance=1e-15, iterations=3))
    np.testing.assert_allclose(output.point.r, expected, rtol=1e-7, atol=1e-9)


def test_strong_coupling_is_bracketed_where_newton_cycles() -> None:
    """One positive definite contact each, 5 rows: all are solved, by the first sweep."""
    hard = 0
    for seed in range(1000, 1200):
        problem, _ = planted_contact.rfc(np.random.default_rng(seed), 1, 3 + 2 * (seed % 2))
        output = solvers.get(SOLVER).run(problem, Budget(tolerance=1e-10))
        assert output.claim is Claim.SOLVED, f"{seed}: {output.message}"
        hard += output.counters["hard_contacts"]
    assert hard > 0


def test_without_rolling_resistance_it_is_coulomb_friction(rng: np.random.Generator) -> None:
    """μ_r = 0: no moments, and the forces solve the contact problem of the other rows, judged by its own node."""
    for seed in range(6):
        made = np.random.default_rng(seed)
        W = planted.square(made, 20, "positive definite")
        q, mu = made.standard_normal(20), made.uniform(0.1, 0.9, 4)
        forces = np.flatnonzero(np.arange(20) % 5 < 3)
        rolling = RollingFrictionContact(W=W, q=q, mu=mu, mu_r=np.zeros(4), dimension=5)
        r = solvers.get(SOLVER).run(rolling, Budget(tolerance=1e-10)).point.r
        assert np.delete(r, forces).any() == np.False_
        coulomb = FrictionContact(W=W[np.ix_(forces, forces)], q=q[forces], mu=mu)
        assert judge(coulomb, FCPoint(r[forces]), 1e-9).solved


def test_the_unit_of_length_changes_nothing() -> None:
    """Moments in N mm, angular velocities in rad/s: the same sweeps to the same forces."""
    problem, _ = planted_contact.rfc(np.random.default_rng(7), 5, 5)
    length = np.tile([1.0, 1.0, 1.0, 1e3, 1e3], 5)
    other = RollingFrictionContact(
        W=problem.W / length[:, None] / length,
        q=problem.q / length,
        mu=problem.mu,
        mu_r=problem.mu_r * 1e3,
        dimension=5,
    )
    one, two = (solvers.get(SOLVER).run(p, Budget(tolerance=1e-8)) for p in (problem, other))
    assert one.counters["iterations"] == two.counters["iterations"]
    np.testing.assert_allclose(one.point.r * length, two.point.r, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("d", [3, 5])
def test_the_natural_step_projects_like_the_reference(rng: np.random.Generator, d: int) -> None:
    """A contact whose W_NN is 0 takes one step P_K(r − ρ û); here W_NN = 0 and the rest couples to nothing."""
    for _ in range(20):
        mu, mu_r = rng.uniform(0.0, 1.5, 2)
        W, q = np.diag(np.r_[0.0, np.ones(d - 1)]), rng.standard_normal(d)
        q[0] = -abs(q[0])
        problem = RollingFrictionContact(W=W, q=q, mu=[mu], mu_r=[mu_r], dimension=d)
        r = np.abs(rng.standard_normal(d))
        L = problem.lengths.ravel()
        hat = cones.rolling_de_saxce((L * (W @ r + q))[None], np.array([mu]), np.array([mu_r / L[-1]]))
        step = (r / L)[None] - problem.rho[:, None] * hat
        expected = L * cones.project_rolling_cone(step, np.array([mu]), np.array([mu_r / L[-1]]))[0]
        kernel = rolling_gauss_seidel
        solver = solvers.get(SOLVER)
        prepared = solver.setup(problem, Budget(), solver.spec.options()).prepared
        data = *prepared.matrix, *prepared.law, *prepared.local
        own = r / L
        state, iterate = np.zeros(5, np.int64), (own, own.copy(), np.zeros((1, 2)), np.arange(1), 1.0, False)
        kernel.sweeps(*data, *iterate, 0.0, 1, state, np.zeros(3), False)
        assert (state[kernel.ITERATION], state[kernel.HARD]) == (1, 1)
        np.testing.assert_allclose(L * own, expected, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("d", [3, 5])
def test_the_compiled_error_is_that_of_the_residuals(rng: np.random.Generator, d: int, sparse: bool) -> None:
    kernel = rolling_gauss_seidel
    solver = solvers.get(SOLVER)
    for nc in (1, 2, 7):
        problem, point = planted_contact.rfc(rng, nc, d, sparse=sparse)
        prepared = solver.setup(problem, Budget(), solver.spec.options()).prepared
        for size in (0.0, 1e-6, 1.0, 1e3):
            r = point.r + size * rng.standard_normal(nc * d)
            measured = kernel.judged(*prepared.matrix, *prepared.law, r / prepared.lengths)
            assert measured == pytest.approx(problem.residuals(FCPoint(r)).error, rel=1e-9, abs=1e-14)


def test_a_part_that_is_small_beside_another_is_right(rng: np.random.Generator) -> None:
    """Two scenes that do not touch, the second one with a ten-thousandth of the loads."""
    for _ in range(5):
        first, second = (planted_contact.rfc(rng, 4, 5)[0] for _ in range(2))
        W: Any = sp.block_diag([sp.csr_array(first.W), sp.csr_array(second.W)]).toarray()
        mu, mu_r = (np.concatenate([getattr(P, name) for P in (first, second)]) for name in ("mu", "mu_r"))
        problem = RollingFrictionContact(W=W, q=np.concatenate([first.q, 1e-4 * second.q]), mu=mu, mu_r=mu_r)
        output = solvers.get(SOLVER).run(problem, Budget(tolerance=1e-6))
        assert output.claim is Claim.SOLVED
        assert judge(problem, output.point, 1e-6).solved
