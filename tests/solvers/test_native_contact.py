"""NSGS: its one-contact solve against an independent search, its sweep against plain NumPy, real files; and what every
method on contact does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import planted
import pytest
import scipy.sparse as sp
from claims import assert_claim, compiled_error
from references.nsgs import one_contact

from cpbench import storage
from cpbench.formulations import FCPoint, FrictionContact
from cpbench.foundation import cones
from cpbench.solvers import Budget, Claim, SolverOutput, solvers
from cpbench.verification import judge
from cpbench_solvers.contact import sweeps as contact_sweeps
from cpbench_solvers.kernels import contact_error, contact_splitting
from cpbench_solvers.kernels.one_contact import projected

METHODS = (
    "nsgs", "newton-alart-curnier", "newton-natural-map", "proximal-newton", "interior-point-fc", "admm-fc", "apgd-fc",
    "tresca-fixed-point", "aclm-fixed-point", "de-saxce-fixed-point", "extragradient-fc", "auto-fc",
)  # fmt: skip


def answer(output: SolverOutput) -> FCPoint:
    assert output.point is not None, output.message
    return output.point


def block(rng: np.random.Generator, skew: float) -> np.ndarray:
    G = rng.standard_normal((3, 3))
    S = rng.standard_normal((3, 3))
    D = G @ G.T + 0.5 * np.eye(3)
    # weak coupling of the normal with the tangents keeps the one-contact problem uniquely solvable
    D[0, 1:] *= 0.2
    D[1:, 0] *= 0.2
    return D + skew * (S - S.T)


@pytest.mark.parametrize("skew", [0.0, 0.05])
def test_one_contact_is_solved_exactly(rng: np.random.Generator, skew: float) -> None:
    for _ in range(60):
        D, q, mu = block(rng, skew), rng.standard_normal(3) * [1, 3, 3], rng.uniform(0.05, 0.9)
        problem = FrictionContact(W=D, q=q, mu=np.array([mu]), dimension=3)
        output = solvers.get("nsgs").run(problem, Budget(tolerance=1e-12, iterations=50))
        assert judge(problem, output.point, 1e-11).solved
        np.testing.assert_allclose(answer(output).r, one_contact(D, q, mu), rtol=1e-7, atol=1e-9)


def one_contact_2d(D: np.ndarray, q: np.ndarray, mu: float) -> list[np.ndarray]:
    """Every solution of one contact in 2D: each of the four modes is solved for and its inequalities looked at."""
    found = [np.zeros(2)] if q[0] >= 0 else []
    r = np.linalg.solve(D, -q)
    if abs(r[1]) <= mu * r[0]:
        found.append(r)
    for side in (1.0, -1.0):
        edge = np.array([1.0, side * mu])
        r = edge * (-q[0] / (D[0] @ edge))
        if r[0] >= 0 and side * (D[1] @ r + q[1]) <= 0:
            found.append(r)
    return found


@pytest.mark.parametrize("skew", [0.0, 0.3])
def test_one_contact_in_the_plane_is_one_of_its_modes(rng: np.random.Generator, skew: float) -> None:
    modes = set()
    for _ in range(200):
        G = rng.standard_normal((2, 2))
        D = G @ G.T + 0.1 * np.eye(2) + skew * np.array([[0.0, 1.0], [-1.0, 0.0]])
        q, mu = rng.standard_normal(2) * [1, 2], rng.uniform(0.05, 1.5)
        problem = FrictionContact(W=D, q=q, mu=np.array([mu]), dimension=2)
        r = answer(solvers.get("nsgs").run(problem, Budget(tolerance=1e-12, iterations=1))).r
        expected = one_contact_2d(D, q, mu)
        assert min(np.linalg.norm(r - x) for x in expected) <= 1e-9 * (1 + np.linalg.norm(r))
        modes.add("none" if not r.any() else "slide" if abs(abs(r[1]) - mu * r[0]) <= 1e-12 * r[0] else "stick")
    assert modes == {"none", "slide", "stick"}


def test_a_strongly_coupled_contact_is_solved_in_one_sweep(rng: np.random.Generator) -> None:
    """Full nonsymmetric coupling of normal and tangents, where there may be several solutions: any of them will do."""
    for _ in range(200):
        G, S = rng.standard_normal((2, 3, 3))
        D = G @ G.T + 0.1 * np.eye(3) + 0.5 * (S - S.T)
        q, mu = rng.standard_normal(3) * [1, 3, 3], rng.uniform(0.05, 1.5)
        problem = FrictionContact(W=D, q=q, mu=np.array([mu]))
        output = solvers.get("nsgs").run(problem, Budget(tolerance=1e-10, iterations=1))
        assert output.claim is Claim.SOLVED, (D, q, mu)
        assert judge(problem, output.point, 1e-10).solved


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_kernels_error_is_the_judges(rng: np.random.Generator, dimension: int) -> None:
    """At any point, in any units, on any blocks: what NSGS stops on is what `residuals` judges."""
    kernel, solver = contact_error, solvers.get("nsgs")
    for _ in range(60):
        nc = int(rng.integers(1, 8))
        w, s, p = 10.0 ** rng.uniform(-5, 5, 3)
        W = w * rng.standard_normal((nc * dimension, nc * dimension))
        q, r = s * rng.standard_normal(nc * dimension), p * rng.standard_normal(nc * dimension)
        problem = FrictionContact(W=W, q=q, mu=rng.uniform(0, 1, nc), dimension=dimension)
        rows = solver.prepare(problem, Budget(), solver.spec.options())
        matrix = (rows.start, rows.column, rows.blocks, rows.diagonal)
        measured = kernel.judged(*matrix, q, problem.mu, problem.rho, r, dimension)
        assert measured == pytest.approx(problem.residuals(FCPoint(r=r)).error, rel=1e-9)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-4, 1e-8])
def test_sweeps_end_soon_after_the_error_is_small(rng: np.random.Generator, dimension: int, tolerance: float) -> None:
    """Sweeps end by norms, and go on as far as the verdict asks: at most about twice as many as are needed."""
    for nc in (5, 40):
        problem, _ = planted.fc(rng, nc, dimension, "positive definite")
        sweeps, r, error = contact_sweeps.Sweeps(contact_sweeps.block_rows(problem)), np.zeros(nc * dimension), np.inf
        while not error <= tolerance:
            sweeps.sweep(r, 1, 1e-300)
            error = compiled_error(problem, r)
        output = solvers.get("nsgs").run(problem, Budget(tolerance=tolerance))
        assert output.claim is Claim.SOLVED
        assert sweeps.done <= output.counters["iterations"] <= 2 * sweeps.done + 10
        assert output.counters["matrix_vector_products"] <= max(sweeps.done, 0.6 * output.counters["iterations"])


def test_a_sum_that_is_given_up_at_the_last_contact_is_no_error() -> None:
    """Relaxed, so that no contact of a sweep is solved exactly, and few, so that this is often the last."""
    for seed in range(40):
        problem, _ = planted.fc(np.random.default_rng(seed), 2, 3, "positive definite")
        solver = solvers.get("nsgs")
        output = solver.run(problem, Budget(tolerance=1e-8), solver.spec.options(omega=0.8))
        assert output.claim is Claim.SOLVED, (seed, output.message)


def test_the_best_measured_point_is_the_answer() -> None:
    """Over-relaxed sweeps on a hyperstatic problem: the error does not fall from sweep to sweep."""
    rng = np.random.default_rng(5)
    H = rng.standard_normal((6, 36))
    problem = FrictionContact(W=H.T @ H, q=H.T @ rng.standard_normal(6), mu=np.full(12, 0.4))
    solver = solvers.get("nsgs")
    seen: list[float] = []
    budget, options = Budget(tolerance=1e-12, iterations=13), solver.spec.options(omega=1.9)
    output = solver.run(problem, budget, options, record=lambda k, error, point: seen.append(error))
    assert min(seen) < 0.99 * seen[-1]
    assert problem.residuals(answer(output)).error == pytest.approx(min(seen), rel=1e-9)


@pytest.mark.parametrize("folder", ["fc2d_local", "fc3d_local"])
@pytest.mark.filterwarnings("ignore:sparse matrices in this text file")
def test_no_claim_on_a_real_file_is_false(shared_data: Path, folder: str) -> None:
    """Every file, few sweeps: what is claimed solved is, and what is not solved says why."""
    solved = 0
    for path in sorted((shared_data / folder).iterdir()):
        problem = storage.load(path)
        if problem.node != "fc":
            continue
        for tolerance in (1e-4, 1e-8):
            output = solvers.get("nsgs").run(problem, Budget(tolerance=tolerance, iterations=500))
            if output.claim is Claim.SOLVED:
                solved += 1
                assert_claim(problem, output.point, tolerance)
            else:
                assert output.message, path.name
    assert solved > 0


@pytest.mark.parametrize("mu", [0.0, 1e-3, 0.5])
def test_kernels_project_as_the_cone_does(mu: float) -> None:
    """Also (−1, 0, 0) without friction, which is on the wrong side of the apex and has no tangential part."""
    for x in ([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 2.0], [-1.0, 3.0, 4.0], [1.0, 3.0, 4.0]):
        row, z, xi = np.array(x), np.zeros(3), np.zeros(3)
        expected = cones.project_friction_cone(row[None, :], np.array([mu]))[0]
        np.testing.assert_allclose(projected(*x, mu), expected, atol=1e-15)
        contact_splitting.advance(row, np.array([mu]), 1.0, 1.0, 3, z, xi, np.zeros(1), np.zeros(4))
        np.testing.assert_allclose(z, expected, atol=1e-15)
        np.testing.assert_allclose(xi, row - expected, atol=1e-15)
        assert expected[0] >= 0.0


@pytest.mark.parametrize("solver", ["auto-fc", "nsgs", "admm-fc", "newton-alart-curnier"])
def test_a_contact_without_friction_that_opens_has_no_force(solver: str) -> None:
    """W = I, q_N = −1 and 1: r_N = 1 and 0, by hand. Found by `cpbench hunt -s auto-fc --against nsgs`."""
    problem = FrictionContact(W=np.eye(6), q=np.array([-1.0, 0, 0, 1.0, 0, 0]), mu=np.zeros(2))
    output = solvers.get(solver).run(problem, Budget(tolerance=1e-6))
    assert output.claim is Claim.SOLVED
    np.testing.assert_allclose(answer(output).r, [1.0, 0, 0, 0, 0, 0], atol=1e-6)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("sparse", [False, True])
def test_a_singular_delassus_operator_is_no_obstacle(rng: np.random.Generator, name: str, sparse: bool) -> None:
    """W = HᵀH of rank 24, q in its range: solvable, with a family of reactions."""
    H = rng.standard_normal((24, 72))
    if sparse:
        H[np.abs(H) < 0.8] = 0.0
    W = sp.csr_array(H.T @ H) if sparse else H.T @ H
    problem = FrictionContact(W=W, q=H.T @ rng.standard_normal(24), mu=np.full(24, 0.4), dimension=3)
    output = solvers.get(name).run(problem, Budget(tolerance=1e-6))
    assert output.claim is Claim.SOLVED, output.message
    assert judge(problem, output.point, 1e-6).solved
