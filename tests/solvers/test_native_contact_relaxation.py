"""Local solvers of one contact, Jacobi, projected SOR, symmetric sweeps: against plain NumPy, planted, real files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.polynomial import polynomial
from tiers import some_by_day

from cpbench import storage
from cpbench.formulations import FCPoint, FrictionContact
from cpbench.foundation import cones, kernel_cache
from cpbench.solvers import Budget, Claim, SolverOutput, solvers
from cpbench.testing import planted
from cpbench.verification import judge
from cpbench_solvers.contact.nsgs import NSGSOptions
from cpbench_solvers.contact.relaxation import Local

VARIANTS = ("psor-fc", "jacobi-fc")
SOLVE = [local for local in Local if local is not Local.PROJECTION]
"""Those that solve a contact, and do not only come nearer."""


def answer(output: SolverOutput) -> FCPoint:
    assert output.point is not None, output.message
    return output.point


def coupled(rng: np.random.Generator, nc: int, d: int) -> FrictionContact:
    """Weakly coupled contacts, whose local problems have one solution."""
    n = nc * d
    W = 0.05 * rng.standard_normal((n, n)) + np.diag(rng.uniform(1.0, 2.0, n))
    q = rng.standard_normal(n)
    q[::d] -= 1.0
    return FrictionContact(W=W, q=q, mu=rng.uniform(0.1, 0.8, nc), dimension=d)


def many(problem: FrictionContact, local: Local, sweeps: int, **options: bool) -> np.ndarray:
    output = solvers.get("nsgs").run(
        problem, Budget(tolerance=1e-300, iterations=sweeps), NSGSOptions(local=local, **options)
    )
    return answer(output).r


def test_the_roots_are_those_of_numpy(rng: np.random.Generator) -> None:
    local = kernel_cache.load("cpbench_solvers.kernels.contact_local")
    found = 0
    for _ in range(300):
        c = rng.standard_normal(5) * 10.0 ** rng.uniform(-2, 2, 5)
        roots, split = np.zeros(4), np.zeros(6)
        count = local.roots_in_unit(c, roots, split)
        every = polynomial.polyroots(c)
        expected = np.sort(every[np.abs(every.imag) < 1e-9].real)
        expected = expected[(expected > 0) & (expected <= 1)]
        np.testing.assert_allclose(roots[:count], expected, rtol=1e-7)
        found += count
    assert found > 100


@pytest.mark.parametrize("local", some_by_day(list(Local), 2))
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_contact_is_solved_in_one_sweep(rng: np.random.Generator, dimension: int, local: Local) -> None:
    """Full nonsymmetric coupling of normal and tangents: nearly always by iterations, always by formulas."""
    solved = 0
    for _ in range(100):
        G, S = rng.standard_normal((2, dimension, dimension))
        D = G @ G.T + 0.1 * np.eye(dimension) + 0.5 * (S - S.T)
        q, mu = rng.standard_normal(dimension) * ([1, 3, 3][:dimension]), rng.uniform(0.05, 1.5)
        problem = FrictionContact(W=D, q=q, mu=np.array([mu]), dimension=dimension)
        r = many(problem, local, 1)
        solved += judge(problem, FCPoint(r), 1e-9).solved
    least = {Local.EXACT: 100, Local.QUARTIC: 100, Local.NEWTON: 90, Local.PROJECTIONS: 80, Local.PROJECTION: 30}
    assert solved >= least[local]


def test_the_nearest_of_several_solutions_is_taken() -> None:
    """Painlevé in the plane: W_NN + μW_NT < 0, q_N > 0, where the contact is open, sticks, or slides."""
    D, q = np.array([[1.0, -2.0], [-2.0, 5.0]]), np.array([0.5, -2.0])
    problem = FrictionContact(W=D, q=q, mu=np.array([0.9]), dimension=2)
    solver, options = solvers.get("nsgs"), NSGSOptions(local=Local.QUARTIC)
    opened = answer(solver.run(problem, Budget(tolerance=1e-12, iterations=5), options, start=FCPoint(np.zeros(2)))).r
    assert not opened.any()
    stick = np.linalg.solve(D, -q)
    assert abs(stick[1]) <= 0.9 * stick[0]
    near = FCPoint(1.01 * stick)
    stuck = answer(solver.run(problem, Budget(tolerance=1e-12, iterations=5), options, start=near)).r
    np.testing.assert_allclose(stuck, stick, rtol=1e-9)


@pytest.mark.parametrize("local", SOLVE)
@pytest.mark.parametrize("dimension", [2, 3])
def test_local_solvers_make_the_same_sweeps(rng: np.random.Generator, dimension: int, local: Local) -> None:
    problem = coupled(rng, 12, dimension)
    np.testing.assert_allclose(many(problem, local, 3), many(problem, Local.EXACT, 3), rtol=1e-7, atol=1e-9)


def test_symmetric_sweeps_go_back(rng: np.random.Generator) -> None:
    """Forward, then backward: the same as a sweep over the contacts and one over them in reverse order."""
    problem = coupled(rng, 8, 3)
    both = many(problem, Local.QUARTIC, 2, symmetric=True)
    first = many(problem, Local.EXACT, 1)
    back = np.arange(24).reshape(8, 3)[::-1].ravel()
    reverse = FrictionContact(W=np.asarray(problem.W)[np.ix_(back, back)], q=problem.q[back], mu=problem.mu[::-1])
    output = solvers.get("nsgs").run(reverse, Budget(tolerance=1e-300, iterations=1), start=FCPoint(first[back]))
    np.testing.assert_allclose(both[back], answer(output).r, rtol=1e-8, atol=1e-10)


def test_a_sweep_of_projected_sor_is_that_of_plain_numpy(rng: np.random.Generator) -> None:
    problem = coupled(rng, 6, 3)
    W, omega, r = np.asarray(problem.W), 1.3, np.zeros(18)
    for _ in range(4):
        for c in range(6):
            at = slice(3 * c, 3 * c + 3)
            D, u = W[at, at], W[at] @ r + problem.q[at]
            mu = problem.mu[c : c + 1]
            step = omega / np.sqrt(np.linalg.norm(D, 1) * np.linalg.norm(D, np.inf))
            r[at] = cones.project_friction_cone((r[at] - step * cones.de_saxce(u[None], mu)[0])[None], mu)[0]
    solver = solvers.get("psor-fc")
    output = solver.run(problem, Budget(tolerance=1e-300, iterations=4), solver.spec.options(omega=omega))
    np.testing.assert_allclose(answer(output).r, r, rtol=1e-9, atol=1e-11)


def test_a_sweep_of_jacobi_solves_all_contacts_with_the_old_velocities(rng: np.random.Generator) -> None:
    problem = coupled(rng, 6, 3)
    W, r = np.asarray(problem.W), np.zeros(18)
    for _ in range(3):
        new = np.empty(18)
        for c in range(6):
            at = slice(3 * c, 3 * c + 3)
            D = W[at, at]
            alone = FrictionContact(W=D, q=W[at] @ r - D @ r[at] + problem.q[at], mu=problem.mu[c : c + 1])
            new[at] = many(alone, Local.EXACT, 1)
        r += 0.8 * (new - r)
    solver = solvers.get("jacobi-fc")
    output = solver.run(problem, Budget(tolerance=1e-300, iterations=3), solver.spec.options(omega=0.8))
    np.testing.assert_allclose(answer(output).r, r, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("name", VARIANTS)
@pytest.mark.parametrize("dimension", [2, 3])
def test_planted_contacts_are_solved(name: str, dimension: int) -> None:
    """Jacobi from ω = 1 too, where it swings between bounded points until ω has fallen; sparse as dense."""
    for seed in range(4):
        problem, _ = planted.fc(np.random.default_rng(seed), 8, dimension, "positive definite")
        stored = FrictionContact(W=sp.csr_array(problem.W), q=problem.q, mu=problem.mu, dimension=dimension)
        for now in (problem, stored):
            output = solvers.get(name).run(now, Budget(tolerance=1e-8))
            assert output.claim is Claim.SOLVED, output.message
            assert judge(problem, answer(output), 1e-8).solved


@pytest.mark.parametrize("name", VARIANTS)
def test_what_has_no_solution_stalls(name: str) -> None:
    problem = FrictionContact(W=np.diag([0.0, 1.0, 1.0]), q=np.array([-1.0, 0.5, 0.0]), mu=np.array([0.5]))
    output = solvers.get(name).run(problem, Budget(seconds=120.0))
    assert output.claim is Claim.FAILED
    assert "stalled" in output.message or "diverged" in output.message


@pytest.mark.parametrize("local", list(Local))
def test_void_blocks_raise_nothing(local: Local) -> None:
    for D in (np.zeros((3, 3)), np.diag([0.0, 1, 1]), np.diag([1.0, 0, 0]), np.ones((3, 3)), -np.eye(3)):
        for q in ([-1.0, 0.5, 0], [1.0, 0.5, 0], [0.0, 0, 0]):
            problem = FrictionContact(W=D, q=np.array(q), mu=np.array([0.5]), dimension=3)
            output = solvers.get("nsgs").run(problem, Budget(iterations=100), NSGSOptions(local=local))
            assert np.isfinite(answer(output).r).all()
            assert output.claim is not Claim.SOLVED or judge(problem, answer(output), 1e-6).solved


def test_a_seed_gives_the_same_order(rng: np.random.Generator) -> None:
    problem, _ = planted.fc(rng, 12, 3, "positive definite")
    options, solver = NSGSOptions(local=Local.NEWTON, shuffle=True), solvers.get("nsgs")
    a, b, c = (answer(solver.run(problem, Budget(tolerance=1e-9, seed=s), options)).r for s in (1, 1, 2))
    assert (a == b).all()
    assert (a != c).any()


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("psor-fc", "Rover1039.dat"),
        ("psor-fc", "Confeti-ex03-Fc3D-SBM.dat"),
        ("jacobi-fc", "LMGC_100_PR_PerioBox-i00361-60-03000.hdf5"),
    ],
)
def test_real_files(shared_data: Path, name: str, file: str) -> None:
    problem = storage.load(shared_data / "fc3d_local" / file)
    output = solvers.get(name).run(problem, Budget(tolerance=1e-6, seconds=120.0))
    assert output.claim is Claim.SOLVED, output.message
    assert judge(problem, answer(output), 1e-6).solved
