"""Splitting, projection and Newton on LCPs and bounds: kernels against plain NumPy, planted and degenerate problems."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import planted
import pytest
import scipy.sparse as sp
from claims import assert_claim

from cpbench import storage
from cpbench.formulations import LCP, QP
from cpbench.formulations.ncp_functions import minimum
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.lcp.claims import scale
from cpbench_solvers.lcp.mprgp import MPRGPOptions
from cpbench_solvers.lcp.semismooth_newton import LCPBox
from cpbench_solvers.nonlinear.merit_search import Descent


def poisson(m: int) -> sp.csr_array:
    """Five-point Laplacian on m × m points of the unit square."""
    T = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(m, m))
    one = sp.eye_array(m)
    return sp.csr_array((sp.kron(T, one) + sp.kron(one, T)) * (m + 1) ** 2)


def membrane(m: int) -> LCP:
    """An elastic membrane on a plane, one half of it pushed down and the other pulled up: z is the gap."""
    return LCP(M=poisson(m), q=np.where(np.arange(m * m) % m < m // 2, 8.0, -8.0))


@pytest.mark.parametrize("solver", ["pgs", "psor"])
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


def reference_mprgp(M: np.ndarray, q: np.ndarray, lower: np.ndarray, upper: np.ndarray, steps: int) -> np.ndarray:
    """Dostál and Schöberl's algorithm, Γ = 1, expansions of length 1.9 over the kernel's estimate of ‖M‖."""
    x, n, size = np.clip(np.zeros(q.size), lower, upper), q.size, 0.0
    v = np.cos(np.arange(n))
    for _ in range(6):
        v, before = M @ v, v
        size = max(size, np.linalg.norm(v) / np.linalg.norm(before))
    g = M @ x + q

    def parts() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        inside = (lower < x) & (x < upper)
        phi = np.where(inside, g, 0.0)
        beta = np.where(lower == upper, 0.0, np.where(x <= lower, np.minimum(g, 0), np.where(inside, 0, g.clip(0))))
        return (
            phi,
            beta,
            np.where(phi > 0, np.minimum((x - lower) * size / 1.9, phi), phi.clip((x - upper) * size / 1.9)),
        )

    p = parts()[0]
    for _ in range(steps):
        phi, beta, reduced = parts()
        release = beta @ beta > phi @ reduced
        p = beta if release else p
        Mp = M @ p
        size = max(size, p @ Mp / (p @ p))
        t = g @ p / (p @ Mp)
        with np.errstate(all="ignore"):
            most = np.where(p > 0, (x - lower) / p, np.where(p < 0, (x - upper) / p, np.inf)).min()
        if t <= most or release:
            x, g = np.clip(x - min(t, most) * p, lower, upper), g - min(t, most) * Mp
            p = (
                parts()[0]
                if release
                else np.where((lower < x) & (x < upper), parts()[0] - parts()[0] @ Mp / (p @ Mp) * p, 0)
            )
        else:
            x, g = np.clip(x - most * p, lower, upper), g - most * Mp
            x = np.clip(x - 1.9 / size * parts()[0], lower, upper)
            g = M @ x + q
            p = parts()[0]
    return x


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("steps", [1, 3, 8, 15])
def test_steps_of_mprgp_are_those_of_plain_numpy(rng: np.random.Generator, sparse: bool, steps: int) -> None:
    A = planted.square(rng, 20, "positive definite") + 0.1 * np.eye(20)
    M = A / np.sqrt(np.outer(A.diagonal(), A.diagonal()))
    q, lower = rng.standard_normal(20), -rng.uniform(0, 1, 20)
    upper = lower + rng.uniform(0, 2, 20)
    lower[:5], upper[3:8], upper[9] = -np.inf, np.inf, lower[9]
    stored = sp.csr_array(M) if sparse else M
    budget = Budget(tolerance=1e-16, iterations=steps)
    output = solvers.get("mprgp-qp").run(QP.build(stored, q, lb=lower, ub=upper), budget)
    np.testing.assert_allclose(output.point.z, reference_mprgp(M, q, lower, upper, steps), rtol=1e-9, atol=1e-11)
    zero, inf = np.zeros(20), np.full(20, np.inf)
    output = solvers.get("mprgp").run(LCP(M=stored, q=q), budget)
    np.testing.assert_allclose(output.point.z, reference_mprgp(M, q, zero, inf, steps), rtol=1e-9, atol=1e-11)


FACES = (False, True)
"""Whether a face is expanded by projecting the step of conjugate gradients."""


def by_faces(solver: str, problem: LCP | QP, projected: bool, tolerance: float, start: Any = None) -> Any:
    options = MPRGPOptions(projected=projected)
    return solvers.get(solver).run(problem, Budget(tolerance=tolerance), options, start=start)


@pytest.mark.parametrize("projected", FACES)
@pytest.mark.parametrize("kind", ["positive definite", "singular semidefinite"])
@pytest.mark.parametrize("sparse", [False, True])
def test_faces_solve_semidefinite_problems(projected: bool, kind: str, sparse: bool) -> None:
    """A singular M may have many solutions: judged by residuals."""
    for seed in range(10):
        problem, _ = planted.lcp(np.random.default_rng(seed), 30, kind, sparse=sparse)
        if not problem.symmetric:
            continue
        output = by_faces("mprgp", problem, projected, 1e-9)
        assert output.claim is Claim.SOLVED, output.message
        assert_claim(problem, output.point, 1e-9)


@pytest.mark.parametrize("projected", FACES)
def test_faces_prove_that_there_is_no_solution(projected: bool) -> None:
    """M = BBᵀ of rank 6 of 10 and q with qᵀy < 0 for a y ≥ 0 in its kernel."""
    rng = np.random.default_rng(4)
    for _ in range(10):
        y = np.maximum(rng.standard_normal(10), 0.0)
        B = rng.standard_normal((10, 6))
        B -= np.outer(y, y @ B) / (y @ y)
        q = rng.standard_normal(10)
        problem = LCP(M=B @ B.T, q=q - (q @ y + 0.1) * y / (y @ y))
        output = by_faces("mprgp", problem, projected, 1e-8)
        assert output.claim is Claim.INFEASIBLE, output.message
        assert problem.certifies_infeasibility(output.certificate)


def test_faces_refuse_what_is_not_semidefinite_and_symmetric() -> None:
    chosen = solvers.get("mprgp")
    assert "symmetric" in chosen.obstacle(LCP(M=np.array([[1.0, 1.0], [0.0, 1.0]]), q=np.ones(2)))
    assert "semidefinite" in chosen.obstacle(LCP(M=np.diag([1.0, -1.0]), q=np.ones(2)))


@pytest.mark.parametrize("projected", FACES)
def test_an_objective_without_a_least_value_is_proved_so(projected: bool) -> None:
    """z₁ + z₂ is not in Q and falls; with a bound on z₂ it still does, with both it does not."""
    Q, p, free = np.array([[1.0, 1, 0], [1, 1, 0], [0, 0, 2]]), np.array([1.0, -1, 3]), np.full(3, -np.inf)
    assert by_faces("mprgp-qp", QP.build(Q, p, lb=free), projected, 1e-6).claim is Claim.UNBOUNDED
    bounded = QP.build(Q, p, lb=np.array([-2.0, -np.inf, 0.0]))
    output = by_faces("mprgp-qp", bounded, projected, 1e-9)
    assert output.claim is Claim.SOLVED
    np.testing.assert_allclose(output.point.z, [-2.0, 3.0, 0.0], atol=1e-8)
    flat = QP.build(np.zeros((2, 2)), [-1.0, 0.0], lb=np.zeros(2))
    assert by_faces("mprgp-qp", flat, projected, 1e-6).claim is Claim.UNBOUNDED
    assert solvers.get("mprgp-qp").obstacle(QP.build(np.eye(2), np.ones(2), A=np.ones((1, 2)), b=np.ones(1)))


def test_published_bound_constrained_programs(shared_data: Path) -> None:
    """Obstacles, journal bearings, torsion and others of CUTEst. CHENHARK has a condition number of about 1e11."""
    for path in sorted((shared_data / "box_qp").glob("*.npz")):
        if path.stem.startswith(("NCVX", "CHENHARK")):
            continue
        problem = storage.load(path)
        for projected in FACES:
            output = by_faces("mprgp-qp", problem, projected, 1e-8)
            assert output.claim is Claim.SOLVED, (path.name, output.message)
            assert_claim(problem, output.point, 1e-8)


NEWTON = ("newton-min", "newton-fb", "newton-pfb")


def test_a_singular_jacobian_is_regularized_and_counted() -> None:
    """From z = 0 all of w is negative, and M, of rank 1, is the first matrix."""
    problem = LCP(M=np.ones((3, 3)), q=[-1.0, -1.0, -0.5])
    output = solvers.get("newton-min").run(problem, Budget(tolerance=1e-9))
    assert output.claim is Claim.SOLVED
    assert output.counters["regularized"] >= 1


@pytest.mark.parametrize("solver", NEWTON)
def test_newton_says_where_it_is_stuck(solver: str) -> None:
    output = solvers.get(solver).run(LCP(M=-np.eye(3), q=-np.ones(3)), Budget(seconds=120.0))
    assert output.claim is Claim.FAILED
    assert "stuck at error" in output.message
    assert output.counters["restarts"] > 0


def test_only_the_active_part_of_a_jacobian_is_factored() -> None:
    """The direction of min from rows that bounds decide is that of the whole matrix."""
    rng = np.random.default_rng(2)
    M, z = planted.square(rng, 12, "positive definite"), rng.uniform(0, 1, 12)
    box = LCPBox(scale(LCP(M=M, q=rng.standard_normal(12))))
    descent = Descent(box, minimum, 1, project=True)
    at = descent.at(z)
    V = at.beta[:, None] * box.jacobian(z) + np.diag(at.alpha)
    assert 0 < np.count_nonzero(at.beta == 0) < 12
    np.testing.assert_allclose(descent.newton(at, box.jacobian(z)), np.linalg.solve(V, -at.phi), rtol=1e-9)
