"""ADMM without condensation and with rolling friction: linear algebra against the Delassus form, planted problems."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cpbench import storage
from cpbench.formulations import GFCPoint
from cpbench.solvers import Budget, Claim, solvers
from cpbench.solvers.native.contact.global_admm import Dynamics
from cpbench.testing import planted_contact
from cpbench.verification import judge

SOLVERS = {"gfc": "admm-global", "grfc": "admm-global-rolling", "rfc": "admm-rolling"}


def problem_of(node: str, seed: int, *, sparse: bool) -> tuple[Any, Any]:
    rng = np.random.default_rng(seed)
    if node == "gfc":
        return planted_contact.gfc(rng, 3, 4, 2, 3, sparse=sparse)
    if node == "grfc":
        return planted_contact.grfc(rng, 3, 4, 1, 5, sparse=sparse)
    return planted_contact.rfc(rng, 5, 5, sparse=sparse)


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("node", ["gfc", "grfc"])
def test_the_linear_system_is_that_of_the_condensed_problem(rng: np.random.Generator, node: str, sparse: bool) -> None:
    """(W + ρI) x = right − q and Wx + q with W = [Hᵀ 0]K⁻¹[H; 0] formed, in the units of the method."""
    problem, _ = problem_of(node, 3, sparse=sparse)
    dynamics = Dynamics(problem)
    M, H, G = (A.toarray() if sparse else A for A in (problem.M, problem.H, problem.G))
    n, p = G.shape
    K = np.block([[M, -G], [G.T, np.zeros((p, p))]])
    inverse = np.linalg.inv(K)[:n]
    S = np.diag(dynamics.s)
    W = S @ H.T @ inverse[:, :n] @ H @ S
    q = dynamics.s * (H.T @ inverse @ np.r_[problem.f, -problem.b] + problem.w)
    x, right = rng.standard_normal((2, q.size))
    np.testing.assert_allclose(dynamics.velocity(x), W @ x + q, atol=1e-9)
    for rho in (1e-3, 1.0):
        dynamics.factorize(rho)
        expected = np.linalg.solve(W + rho * np.eye(q.size), right - q)
        np.testing.assert_allclose(dynamics.resolvent(right), expected, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("node", SOLVERS)
def test_planted_problems_are_solved(node: str, sparse: bool) -> None:
    for seed in range(2):
        problem, _ = problem_of(node, seed, sparse=sparse)
        output = solvers.get(SOLVERS[node]).run(problem, Budget(tolerance=1e-7))
        assert output.claim is Claim.SOLVED, output.message
        assert judge(problem, output.point, 1e-7).solved


@pytest.mark.parametrize("node", SOLVERS)
def test_a_warm_start_costs_nothing(node: str) -> None:
    problem, answer = problem_of(node, 0, sparse=False)
    output = solvers.get(SOLVERS[node]).run(problem, Budget(tolerance=1e-8), start=answer)
    assert (output.claim, output.counters["iterations"]) == (Claim.SOLVED, 0)


@pytest.mark.parametrize("node", SOLVERS)
def test_a_start_near_the_answer_saves_iterations(rng: np.random.Generator, node: str) -> None:
    problem, answer = problem_of(node, 0, sparse=False)
    solver = solvers.get(SOLVERS[node])
    near = answer.r + 1e-6 * rng.standard_normal(answer.r.size)
    start = GFCPoint(v=answer.v, r=near, lam=answer.lam) if node != "rfc" else type(answer)(r=near)
    warm = solver.run(problem, Budget(tolerance=1e-8), start=start).counters["iterations"]
    assert warm < solver.run(problem, Budget(tolerance=1e-8)).counters["iterations"]


def test_joints_given_twice_are_no_obstacle() -> None:
    """K is singular, λ not unique: the velocities and the constraints are right all the same."""
    problem, _ = problem_of("gfc", 1, sparse=False)
    twice = type(problem)(
        M=problem.M,
        H=problem.H,
        G=np.hstack([problem.G, problem.G]),
        f=problem.f,
        w=problem.w,
        b=np.tile(problem.b, 2),
        mu=problem.mu,
        dimension=3,
    )
    assert twice.saddle.singular
    output = solvers.get("admm-global").run(twice, Budget(tolerance=1e-7))
    assert output.claim is Claim.SOLVED, output.message
    point: Any = output.point
    np.testing.assert_allclose(twice.G.T @ point.v, -twice.b, atol=1e-8)


def test_a_body_without_mass_is_refused() -> None:
    problem, _ = problem_of("gfc", 1, sparse=False)
    M = np.array(problem.M)
    M[0], M[:, 0] = 0.0, 0.0
    massless = type(problem)(M=M, H=problem.H, f=problem.f, w=problem.w, mu=problem.mu, dimension=3)
    assert "singular" in (solvers.get("admm-global").obstacle(massless) or "")


@pytest.mark.parametrize(
    ("file", "tolerance"),
    [
        ("fc3d_global/CubeH8.hdf5", 1e-8),
        ("fc3d_global/mj_box_wall8x8-nc450-global.hdf5", 1e-8),
        ("fc3d_global/spheres-in-a-box-98-i10000-256-10.hdf5", 1e-4),
        ("rolling_global/Chute-ndof-768-nc-4-3.hdf5", 1e-8),
        ("rolling_local/rockfall_14_25792.dat", 1e-8),
    ],
)
def test_real_files(shared_data: Path, file: str, tolerance: float) -> None:
    problem = storage.load(shared_data / file)
    output = solvers.get(SOLVERS[problem.node]).run(problem, Budget(tolerance=tolerance, seconds=60.0))
    assert output.claim is Claim.SOLVED, output.message
    assert judge(problem, output.point, tolerance).solved
