"""Ten native methods beside a plain reference of each: the same iterates, or the same pivots and answer.

A reference (`references/`) follows the paper with dense NumPy arrays and shares no code with the kernels. Iterates
differ by rounding, which the steps of a method carry on: a comparison names how much of it there may be.
"""

from __future__ import annotations

from itertools import islice
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from references.admm_fc import admm_fc
from references.dual_active_set import dual_active_set
from references.interior_point_fc import interior_point_fc
from references.interior_point_qp import interior_point_qp
from references.lemke import lemke
from references.newton_alart_curnier import newton_alart_curnier
from references.newton_min import newton_min
from references.nsgs import nsgs
from references.psor import psor
from references.semismooth_newton import semismooth_newton

from cpbench.formulations import LCP, QP, FrictionContact, MiCP
from cpbench.formulations.expressions.recording import recorded as expression
from cpbench.solvers import Budget, Claim, solvers
from cpbench_solvers.contact.semismooth_newton import ContactNewtonOptions
from cpbench_solvers.qp.interior_point import Path, QPInteriorPointOptions
from cpbench_solvers.qp.presolve import sparse_data
from cpbench_solvers.qp.scaling import sparse_scaled

Rng = np.random.Generator


def recorded(name: str, problem: Any, budget: Budget, options: Any = None) -> dict[int, np.ndarray]:
    """Return what a solver records: its iterates by their numbers, without a last refinement."""
    seen: dict[int, np.ndarray] = {}

    def record(iteration: int, error: float, point: Any) -> None:
        seen[iteration] = np.array(next(iter(vars(point()).values())))

    done = solvers.get(name).run(problem, budget, options, record=record).counters["iterations"]
    return {iteration: iterate for iteration, iterate in seen.items() if iteration <= done}


def assert_same(seen: dict[int, np.ndarray], expected: list[np.ndarray], tolerance: float, least: int) -> None:
    """Compare the iterates that were recorded, at least so many beside the start, in the norm of the whole."""
    compared = [k for k in seen if 0 < k < len(expected)]
    assert len(compared) >= least
    for k in compared:
        assert np.linalg.norm(seen[k] - expected[k]) <= tolerance * np.linalg.norm(expected[k]), f"iterate {k}"


def semidefinite_lcp(rng: Rng, n: int, even: float = 1.0, skew: float = 0.3, least: float = 1.0) -> LCP:
    """M = even GGᵀ/n + skew (S − Sᵀ) + least I with drawn G and S, and a planted solution."""
    G, S = rng.standard_normal((2, n, n))
    M = even * G @ G.T / n + skew * (S - S.T) + least * np.eye(n)
    z, w = np.maximum(rng.standard_normal(n), 0.0), np.zeros(n)
    w[z == 0.0] = rng.uniform(0.01, 1.0, (z == 0.0).sum())
    return LCP(M=M, q=w - M @ z)


def contacts(rng: Rng, nc: int, d: int) -> FrictionContact:
    """Dense W ≻ 0 of one connected part, and forces that open, hold and slide contacts."""
    G = rng.standard_normal((d * nc, 2 * d * nc))
    q = rng.standard_normal(d * nc) * np.tile([1.0, *[0.7] * (d - 1)], nc)
    q[::d] -= 0.5
    return FrictionContact(W=G @ G.T / (2 * d * nc), q=q, mu=rng.uniform(0.2, 0.8, nc), dimension=d)


@pytest.mark.parametrize("n", [3, 8, 16, 17, 40])
def test_lemke_takes_the_pivots_of_its_reference(rng: Rng, n: int) -> None:
    """Small problems use the whole tableau, larger ones its columns; drawn matrices end in rays as well."""
    rays = 0
    for draw in range(20):
        problem = semidefinite_lcp(rng, n)
        if draw % 2:
            problem = LCP(M=rng.standard_normal((n, n)), q=rng.standard_normal(n))
        z, pivots = lemke(problem.M, problem.q)
        output = solvers.get("lemke").run(problem, Budget(tolerance=1e-9, iterations=10_000))
        assert output.counters["pivots"] == pivots
        rays += z is None
        if z is not None:
            assert output.claim is Claim.SOLVED
            np.testing.assert_allclose(output.point.z, z, rtol=1e-6, atol=1e-8 * np.abs(z).max())
    assert rays > 0


@pytest.mark.parametrize(
    ("name", "options"), [("pgs", {}), ("psor", {"omega": 1.3}), ("psor", {"omega": 1.3, "symmetric": True})]
)
def test_relaxations_make_the_sweeps_of_their_reference(rng: Rng, name: str, options: dict[str, Any]) -> None:
    problem = semidefinite_lcp(rng, 30)
    expected = [np.zeros(30), *islice(psor(problem.M, problem.q, **{"omega": 1.0} | options), 60)]
    chosen = solvers.get(name).spec.options(**options)
    for M in (problem.M, sp.csr_array(problem.M)):
        seen = recorded(name, LCP(M=M, q=problem.q), Budget(tolerance=0.0, iterations=60), chosen)
        assert_same(seen, expected, 1e-12, 10)


@pytest.mark.parametrize(("matrix", "least"), [((1.0, 0.3, 1.0), 20), ((0.05, 0.2, 0.05), 80)])
def test_newton_on_the_minimum_takes_the_steps_of_its_reference(rng: Rng, matrix: Any, least: int) -> None:
    """Those of the second kind are shortened, or take the other direction. Both scale M and q to size one."""
    steps = 0
    for _ in range(10):
        problem = semidefinite_lcp(rng, 20, *matrix)
        m, p = np.abs(problem.M).max(), np.abs(problem.q).max()
        seen = recorded("newton-min", problem, Budget(tolerance=1e-9))
        expected = [z * (p / m) for z in islice(newton_min(problem.M / m, problem.q / p), max(seen) + 1)]
        assert_same(seen, expected, 1e-8, 1)
        steps += len(expected) - 1
    assert steps >= least


def test_semismooth_newton_takes_the_steps_of_its_reference(rng: Rng) -> None:
    """F(z) = Mz + q + z³ on unknowns with no bound, one and two."""
    n, steps = 12, 0
    for _ in range(10):
        G, S = rng.standard_normal((2, n, n))
        M, q = G @ G.T / n + S - S.T, 3.0 * rng.standard_normal(n)
        lb = np.where(np.arange(n) % 4 < 2, rng.uniform(-1.0, 0.0, n), -np.inf)
        ub = np.where(np.arange(n) % 2 < 1, rng.uniform(0.1, 1.0, n), np.inf)
        micp = MiCP(F=expression(n, lambda z, M=M, q=q: M @ z + q + z**3), lb=lb, ub=ub, start=rng.standard_normal(n))
        maps = (lambda z, M=M, q=q: M @ z + q + z**3), (lambda z, M=M: M + np.diag(3.0 * z**2))
        seen = recorded("newton-fb-micp", micp, Budget(tolerance=1e-10))
        expected = list(islice(semismooth_newton(*maps, lb, ub, micp.start), max(seen) + 1))
        assert_same(seen, expected, 1e-8, 2)
        steps += len(expected) - 1
    assert steps >= 40


def test_nsgs_makes_the_sweeps_of_its_reference(rng: Rng) -> None:
    for _ in range(3):
        problem = contacts(rng, 6, 3)
        expected = [np.zeros(18), *islice(nsgs(problem.W, problem.q, problem.mu), 30)]
        seen = recorded("nsgs", problem, Budget(tolerance=1e-13, iterations=30))
        assert_same(seen, expected, 1e-9, 4)


@pytest.mark.parametrize("d", [2, 3])
def test_newton_on_alart_curnier_takes_the_steps_of_its_reference(rng: Rng, d: int) -> None:
    for _ in range(3):
        problem = contacts(rng, 6, d)
        seen = recorded("newton-alart-curnier", problem, Budget(tolerance=1e-10), ContactNewtonOptions(sweeps=0))
        expected = list(islice(newton_alart_curnier(problem.W, problem.q, problem.mu, d), max(seen) + 1))
        assert_same(seen, expected, 1e-8, 2)


@pytest.mark.parametrize("d", [2, 3])
def test_admm_makes_the_iterations_of_its_reference(rng: Rng, d: int) -> None:
    for _ in range(3):
        problem = contacts(rng, 6, d)
        seen = recorded("admm-fc", problem, Budget(tolerance=1e-10, iterations=200))
        expected = list(islice(admm_fc(problem.W, problem.q, problem.mu, d), 201))
        assert_same(seen, expected, 1e-9, 20)


@pytest.mark.parametrize("d", [2, 3])
def test_interior_points_on_contact_take_the_steps_of_their_reference(rng: Rng, d: int) -> None:
    for _ in range(3):
        problem = contacts(rng, 6, d)
        seen = recorded("interior-point-fc", problem, Budget(tolerance=1e-10, iterations=30))
        expected = [np.zeros(6 * d), *islice(interior_point_fc(problem.W, problem.q, problem.mu, d), 30)]
        assert_same(seen, expected, 1e-6, 10)


def program(rng: Rng, n: int) -> QP:
    """Strictly convex, with planted x and multipliers: bounds on some unknowns, rows, equations."""
    G = rng.standard_normal((n, n))
    A, C = rng.standard_normal((n // 2, n)), rng.standard_normal((n // 4, n))
    x = rng.standard_normal(n)
    slack, nu = np.maximum(rng.standard_normal(n // 2), 0.0), np.zeros(n)
    lam = np.where(slack > 0.0, 0.0, rng.uniform(0.1, 1.0, n // 2))
    lb, ub = np.full(n, -np.inf), np.full(n, np.inf)
    lb[: n // 2] = x[: n // 2] - np.maximum(rng.standard_normal(n // 2), 0.0)
    ub[n // 4 : 3 * n // 4] = x[n // 4 : 3 * n // 4] + rng.uniform(0.1, 1.0, 3 * n // 4 - n // 4)
    nu[: n // 2] = np.where(lb[: n // 2] == x[: n // 2], rng.uniform(0.1, 1.0, n // 2), 0.0)
    Q = G @ G.T / n + 0.1 * np.eye(n)
    p = A.T @ lam + C.T @ rng.standard_normal(n // 4) + nu - Q @ x
    return QP.build(Q, p, A=A, b=A @ x - slack, C=C, d=C @ x, lb=lb, ub=ub)


@pytest.mark.parametrize("n", [8, 12, 20])
def test_interior_points_take_the_steps_of_mehrotra(rng: Rng, n: int) -> None:
    """From the start of the solver, on its scaled data; its linear systems are regularized, and refined to 1e-9."""
    scales, *matrices = sparse_scaled(sparse_data(program(rng, n)))
    path = Path(scales, *matrices, QPInteriorPointOptions())
    H, G = (dense_of(M, n) for M in matrices)
    S, lower, upper = np.vstack([np.eye(n), G]), scales.lower, scales.upper
    equal = lower == upper
    low, high = np.isfinite(lower) & ~equal, np.isfinite(upper) & ~equal
    C, c = np.vstack([S[low], -S[high]]), np.r_[lower[low], -upper[high]]

    def present() -> list[np.ndarray]:
        t, z = (sides[np.r_[low, high]] for sides in path._data[-1][2:4])
        return [path.x.copy(), path.y[equal], z, t]

    assert path.begin()
    steps = islice(interior_point_qp(H, scales.g, S[equal], lower[equal], C, c, present()), 1, 9)
    for done, expected in enumerate(steps, 1):
        path.advance(0.0, done)
        for part, value in zip(present(), expected, strict=True):
            assert np.linalg.norm(part - value) <= 1e-6 * max(1.0, np.linalg.norm(value)), f"step {done}"


def dense_of(entries: Any, n: int) -> np.ndarray:
    M = np.zeros((entries[0].size - 1, n))
    for i in range(len(M)):
        row = slice(entries[0][i], entries[0][i + 1])
        M[i, entries[1][row]] = entries[2][row]
    return M


@pytest.mark.parametrize("n", [4, 8, 20, 40])
def test_dual_active_set_ends_where_its_reference_does(rng: Rng, n: int) -> None:
    """The kernel lets several rows join at once: the answer and the multipliers are the same, not the passes."""
    qp = program(rng, n)
    low, high = np.isfinite(qp.lb), np.isfinite(qp.ub)
    N = np.vstack([qp.C, qp.A, np.eye(n)[low], -np.eye(n)[high]])
    x, u = dual_active_set(qp.Q, qp.p, N, np.r_[qp.d, qp.b, qp.lb[low], -qp.ub[high]], qp.d.size)
    assert x is not None
    output = solvers.get("dual-active-set").run(qp, Budget(tolerance=1e-10))
    assert output.claim is Claim.SOLVED
    mu, lam, below, above = np.split(u, np.cumsum([qp.d.size, qp.b.size, low.sum()]))
    nu = np.zeros(n)
    nu[low] += below
    nu[high] -= above
    for name, value in {"z": x, "lam": lam, "mu": mu, "nu": nu}.items():
        np.testing.assert_allclose(getattr(output.point, name), value, rtol=1e-8, atol=1e-8, err_msg=name)
