"""Without condensation, and rolling friction: linear algebra against the Delassus form, planted and real problems."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import planted_contact
import pytest
import scipy.sparse as sp
from claims import assert_claim

from cpbench import storage
from cpbench.formulations import FCPoint, GFCPoint
from cpbench.formulations.global_contact import GlobalFrictionContact
from cpbench.formulations.local_contact import FrictionContact
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.contact.admm_global import Dynamics
from cpbench_solvers.contact.auto_global import condensed as condense
from cpbench_solvers.contact.dynamics_error import DynamicsError
from cpbench_solvers.contact.nsgs_global import Bodies, VelocitySweeps
from cpbench_solvers.contact.sweeps import Sweeps, block_rows

SOLVERS = {"gfc": "admm-gfc", "grfc": "admm-grfc", "rfc": "admm-rfc"}


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
    output = solvers.get("admm-gfc").run(twice, Budget(tolerance=1e-7))
    assert output.claim is Claim.SOLVED, output.message
    point: Any = output.point
    np.testing.assert_allclose(twice.G.T @ point.v, -twice.b, atol=1e-8)


def test_a_body_without_mass_is_refused() -> None:
    problem, _ = problem_of("gfc", 1, sparse=False)
    M = np.array(problem.M)
    M[0], M[:, 0] = 0.0, 0.0
    massless = type(problem)(M=M, H=problem.H, f=problem.f, w=problem.w, mu=problem.mu, dimension=3)
    assert "singular" in (solvers.get("admm-gfc").obstacle(massless) or "")


@pytest.mark.parametrize(
    ("file", "tolerance"),
    [
        ("fc3d_global/CubeH8.hdf5", 1e-8),
        ("fc3d_global/mj_box_wall8x8-nc450-global.hdf5", 1e-8),
        ("fc3d_global/spheres-in-a-box-98-i10000-256-10.hdf5", 1e-3),
        ("rolling_global/Chute-ndof-768-nc-4-3.hdf5", 1e-8),
        ("rolling_local/rockfall_14_25792.dat", 1e-8),
    ],
)
def test_real_files(shared_data: Path, file: str, tolerance: float) -> None:
    problem = storage.load(shared_data / file)
    output = solvers.get(SOLVERS[problem.node]).run(problem, Budget(tolerance=tolerance, seconds=120.0))
    assert output.claim is Claim.SOLVED, output.message
    assert_claim(problem, output.point, tolerance)


def bodies(dimension: int, seed: int = 0, nc: int = 24) -> GlobalFrictionContact:
    """Six bodies with full inertia of six unknowns each, contacts between any two of them; nothing planted."""
    rng = np.random.default_rng(seed)
    factors = [rng.standard_normal((6, 6)) for _ in range(6)]
    H = np.zeros((36, dimension * nc))
    for c in range(nc):
        for body in rng.choice(6, 2, replace=False):
            H[6 * body : 6 * body + 6, dimension * c : dimension * (c + 1)] = rng.standard_normal((6, dimension))
    return GlobalFrictionContact(
        M=sp.csr_array(sp.block_diag([sp.csr_array(A @ A.T + np.eye(6)) for A in factors])),
        H=sp.csr_array(H),
        f=rng.standard_normal(36),
        w=rng.standard_normal(dimension * nc),
        mu=rng.uniform(0.1, 0.9, nc),
        dimension=dimension,
    )


def condensed(problem: GlobalFrictionContact) -> FrictionContact:
    H, inverse = problem.H.toarray(), np.linalg.inv(problem.M.toarray())
    q = H.T @ inverse @ problem.f + problem.w
    return FrictionContact(W=H.T @ inverse @ H, q=q, mu=problem.mu, dimension=problem.dimension)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("sweeps", [1, 7])
def test_gauss_seidel_on_velocities_makes_the_iterates_of_gauss_seidel_on_w(dimension: int, sweeps: int) -> None:
    problem = bodies(dimension)
    method = VelocitySweeps(Bodies.of(problem), np.zeros(problem.w.size))
    method.step(sweeps, 1.0, 1.0)
    r = np.zeros(problem.w.size)
    Sweeps(block_rows(condensed(problem))).sweep(r, sweeps, 0.0)
    assert np.abs(r).max() > 0.1
    np.testing.assert_allclose(method.r, r, rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize("dimension", [2, 3])
def test_gauss_seidel_on_velocities_solves_and_starts_warm(dimension: int) -> None:
    problem, solver = bodies(dimension, seed=3), solvers.get("nsgs-gfc")
    output = solver.run(problem, Budget(tolerance=1e-10))
    assert output.claim is Claim.SOLVED, output.message
    assert judge(problem, output.point, 1e-10).solved
    assert condensed(problem).residuals(FCPoint(output.point.r)).error < 1e-9
    again = solver.run(problem, Budget(tolerance=1e-10), start=output.point)
    assert again.counters["iterations"] == 0


def test_what_gauss_seidel_on_velocities_refuses() -> None:
    solver, problem = solvers.get("nsgs-gfc"), bodies(3)
    assert solver.obstacle(problem) is None
    indefinite = dataclasses.replace(problem, M=problem.M - 2 * sp.csr_array(sp.diags_array(problem.M.diagonal())))
    lopsided = problem.M.toarray()
    lopsided[0, 1] *= 1.1
    chain = sp.diags_array([np.full(299, -1.0), np.full(300, 3.0), np.full(299, -1.0)], offsets=[-1, 0, 1])
    long = GlobalFrictionContact(M=sp.csr_array(chain), H=np.eye(300)[:, :3], f=np.ones(300), w=np.zeros(3), mu=[0.5])
    jointed, _ = problem_of("gfc", 1, sparse=True)
    assert "definite" in (solver.obstacle(indefinite) or "")
    assert "symmetric" in (solver.obstacle(dataclasses.replace(problem, M=lopsided)) or "")
    assert "hang together" in (solver.obstacle(long) or "")
    assert "joints" in (solver.obstacle(jointed) or "")


@pytest.mark.parametrize(
    ("file", "tolerance"),
    [
        ("fc3d_global/mj_box_tower10-nc40-global.hdf5", 1e-8),
        ("fc3d_global/mj_dm_dog-nc12-global.hdf5", 1e-8),
        ("fc3d_global/LMGC_GFC3D-i00501-4-00000.hdf5", 1e-8),
        ("fc3d_global/spheres-in-a-box-98-i10000-256-10.hdf5", 1e-4),
        ("fc2d_global/gfc2d_granularflowonwall_00069_00350.dat", 1e-8),
    ],
)
@pytest.mark.filterwarnings("ignore:.*6 digits")
def test_real_files_by_gauss_seidel_on_velocities(shared_data: Path, file: str, tolerance: float) -> None:
    problem = storage.load(shared_data / file)
    output = solvers.get("nsgs-gfc").run(problem, Budget(tolerance=tolerance, seconds=120.0))
    assert output.claim is Claim.SOLVED, output.message
    assert_claim(problem, output.point, tolerance)


def tower(seed: int, dimension: int = 3, decades: float = 3.0) -> GlobalFrictionContact:
    """Four boxes on each other, the ground sloping, four contacts (two in the plane) under each, masses some decades
    apart: hyperstatic, with reactions that are large beside all velocities."""
    rng = np.random.default_rng(seed)
    plane = dimension == 2
    freedoms, corners = (3, [[-1.0], [1.0]]) if plane else (6, [[x, y] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    boxes, per = 4, len(corners)
    masses, n = 10.0 ** rng.uniform(-decades / 2, decades / 2, boxes), boxes * freedoms
    H = np.zeros((n, boxes * per * dimension))
    for box in range(boxes):
        for k, corner in enumerate(corners):
            for sign, body, height in ((1.0, box, -0.5), (-1.0, box - 1, 0.5)):
                if body < 0:
                    continue
                arm = np.array([*corner, height])  # normal is the last axis of the body, first of the contact
                own = slice(body * freedoms, (body + 1) * freedoms)
                for row, axis in enumerate(np.roll(np.eye(dimension), 1, axis=0)):
                    turn = [arm[0] * axis[1] - arm[1] * axis[0]] if plane else np.cross(arm, axis)
                    H[own, (box * per + k) * dimension + row] = sign * np.concatenate([axis, turn])
    weights = np.zeros((boxes, freedoms))
    weights[:, :dimension] = -0.1 * masses[:, None] * np.array([0.1] * (dimension - 1) + [1.0])
    inertia = np.concatenate([np.ones(dimension), np.full(freedoms - dimension, 0.2)])
    return GlobalFrictionContact(
        M=sp.csr_array(sp.diags_array(np.outer(masses, inertia).ravel())),
        H=sp.csr_array(H),
        f=weights.ravel(),
        w=np.zeros(H.shape[1]),
        mu=rng.uniform(0.05, 0.8, boxes * per),
        dimension=dimension,
    )


@pytest.mark.parametrize("name", ["admm-gfc", "auto-gfc", "nsgs-gfc"])
def test_what_is_claimed_of_bodies_that_press_and_hardly_move_is_so(name: str) -> None:
    claimed = 0
    for seed in range(4):
        for tolerance in (1e-4, 1e-8):
            problem = tower(seed, 2 + seed % 2)
            output = solvers.get(name).run(problem, Budget(tolerance=tolerance, seconds=1.0))
            if output.claim is Claim.SOLVED:
                claimed += 1
                assert judge(problem, output.point, tolerance).solved, (seed, tolerance)
    assert claimed >= 6


@pytest.mark.parametrize("name", ["admm-fc", "admm-gfc", "auto-fc", "auto-gfc", "newton-alart-curnier"])
def test_an_answer_that_rounding_hides_is_not_claimed(name: str) -> None:
    """Masses of nine decades press: the error is small, and says nothing at 1e-8; at 1e-6 it does."""
    for tolerance, claim in ((1e-8, Claim.INACCURATE), (1e-6, Claim.SOLVED)):
        solver, problem = solvers.get(name), tower(102, 2, decades=9.0)
        problem = condensed(problem) if solver.spec.node == "fc" else problem
        output = solver.run(problem, Budget(tolerance=tolerance))
        verdict = judge(problem, output.point, tolerance)
        assert verdict.error <= tolerance
        assert (output.claim, verdict.solved) == (claim, claim is Claim.SOLVED)
        assert ("rounding" in output.message) == (not verdict.solved)


@pytest.mark.parametrize("node", ["gfc", "grfc"])
def test_the_error_of_bodies_is_the_verdicts(rng: np.random.Generator, node: str) -> None:
    """As well where the law alone is measured, for velocities that reactions make."""
    for seed in range(4):
        problem, answer = problem_of(node, seed, sparse=bool(seed % 2))
        for size in (1e-6, 1e-3, 1.0):
            r = answer.r * (1.0 + size * rng.standard_normal(answer.r.size))
            force = np.concatenate([problem.f + problem.H @ r, -problem.b])
            v, lam = np.split(problem.saddle.solve(force), [problem.f.size])
            point = GFCPoint(v=v, r=r, lam=lam)
            expected = judge(problem, point, 1e-6).error
            norms = problem.residuals(point, 1e-6).error
            for tolerance, least in ((0.0, 0.0), (np.inf, norms)):
                error = DynamicsError(problem, tolerance)(point)
                assert error == pytest.approx(max(expected, least), rel=1e-6), (seed, size)


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize("joints", [False, True])
def test_small_problems_are_condensed_by_dense_arrays(joints: bool, sparse: bool) -> None:
    """W, q and the diagonal of W of [Hᵀ 0]K⁻¹[H; 0] formed, and the way back; a saddle stays sparse where data are."""
    problem = problem_of("gfc", 2, sparse=sparse)[0] if joints else bodies(3, nc=8)
    if not (joints or sparse):
        problem = dataclasses.replace(problem, M=problem.M.toarray(), H=problem.H.toarray(), G=None)
    assert problem.small
    M, H, G = (A.toarray() if sp.issparse(A) else A for A in (problem.M, problem.H, problem.G))
    n, p = G.shape
    inverse = np.linalg.inv(np.block([[M, -G], [G.T, np.zeros((p, p))]]))
    small = condense(problem)
    assert small is not None
    W = H.T @ inverse[:n, :n] @ H
    np.testing.assert_allclose(np.asarray(small.local.W), W, atol=1e-10 * abs(W).max())
    v = inverse @ np.r_[problem.f, -problem.b]
    np.testing.assert_allclose(small.local.q, H.T @ v[:n] + problem.w, atol=1e-10)
    np.testing.assert_allclose(problem.mobility.ravel(), np.diag(H.T @ np.linalg.solve(M, H)), rtol=1e-9)
    assert sp.issparse(problem.saddle.A) == sp.issparse(problem.M)
    r = np.arange(problem.w.size, dtype=float)
    lifted = inverse @ np.r_[problem.f + H @ r, -problem.b]
    point = small.lift(FCPoint(r))
    np.testing.assert_allclose(np.r_[point.v, point.lam], lifted, rtol=1e-9, atol=1e-9)
