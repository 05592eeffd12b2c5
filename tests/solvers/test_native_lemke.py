"""Lemke's kernels against the method on a full tableau, and what begins elsewhere."""

from __future__ import annotations

import numpy as np
import planted
import pytest

from cpbench.formulations import LCP, LCPPoint
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.lcp import lemke, lemke_run
from cpbench_solvers.lcp.first_basis import dense_lcp
from cpbench_solvers.lcp.principal_transform import transformed

KINDS = ("positive definite", *planted.SQUARE[:3])


def test_a_ray_beyond_one_call(monkeypatch: pytest.MonkeyPatch) -> None:
    """Infeasible and larger than SMALL: the ray is recognised there too, and proven."""
    for module in (lemke, lemke_run):
        monkeypatch.setattr(module, "SMALL", 10)
    rng = np.random.default_rng(2)
    A = rng.standard_normal((30, 12))
    y = np.abs(rng.standard_normal(30))
    # y ≥ 0 in the null space of Mᵀ and qᵀy < 0: no z has Mz + q ≥ 0
    A -= np.outer(y, y @ A) / (y @ y)
    M = A @ A.T
    output = solvers.get("lemke").run(LCP(M=M, q=rng.standard_normal(30) - 3.0 * y))
    assert output.claim is Claim.INFEASIBLE, output.message


def test_no_transform_in_a_singular_basis() -> None:
    problem = LCP(M=np.ones((3, 3)), q=-np.ones(3))
    assert transformed(dense_lcp(problem), np.array([True, True, False])) is None


@pytest.mark.parametrize("kind", KINDS)
def test_guessed_bases_end_in_solutions(kind: str) -> None:
    """Beyond SMALL: from sweeps and without, and a unique solution is the same one."""
    problem, _ = planted.lcp(np.random.default_rng(3), 300, kind)
    found = [
        solvers.get("lemke").run(problem, Budget(tolerance=1e-9), lemke_run.LemkeOptions(crash_sweeps=sweeps))
        for sweeps in (0, 3, 20)
    ]
    assert [output.claim for output in found] == [Claim.SOLVED] * 3
    if kind == "positive definite":
        assert found[2].counters["pivots"] < found[0].counters["pivots"] / 2
        first, *others = [output.point.z for output in found if output.point is not None]
        for z in others:
            np.testing.assert_allclose(z, first, rtol=1e-7, atol=1e-9)


def test_ties_from_a_start() -> None:
    """Small whole numbers tie all the time: columns that nobody has asked for decide, and are brought then."""
    rng, solver = np.random.default_rng(11), solvers.get("lemke")
    asked = 0
    for _ in range(60):
        A = rng.integers(-1, 2, (8, 8)).astype(float)
        problem = LCP(M=A @ A.T + np.eye(8), q=rng.integers(-2, 2, 8).astype(float))
        start = LCPPoint(z=rng.integers(0, 2, 8).astype(float))
        output = solver.run(problem, Budget(tolerance=1e-10), start=start)
        assert output.claim is Claim.SOLVED, output.message
        assert judge(problem, output.point, 1e-10).solved
        asked += output.counters["pivots"]
    assert asked > 0


@pytest.mark.parametrize("n", [8, 300])
def test_units_far_apart_change_neither_the_answer_nor_the_proof(n: int) -> None:
    """A planted LCP, and one without a solution, with rows and unknowns in units 2^-40 to 2^40."""
    rng = np.random.default_rng(n)
    problem, point = planted.lcp(rng, n, "positive definite")
    rows, unknowns = (np.exp2(rng.integers(-40, 41, n)) for _ in range(2))
    uneven = LCP(M=np.asarray(problem.M) * rows[:, None] * unknowns, q=problem.q * rows)
    solver, budget = solvers.get("lemke"), Budget(tolerance=1e-8, seconds=60.0)
    found = solver.run(uneven, budget)
    assert found.claim is Claim.SOLVED
    assert found.point is not None
    np.testing.assert_allclose(found.point.z * unknowns, point.z, rtol=1e-8, atol=1e-9)
    prepared = solver.setup(uneven, budget, lemke_run.LemkeOptions())
    again = solver.solve(prepared, budget, lemke_run.LemkeOptions(), LCPPoint(point.z / unknowns))
    assert again.claim is Claim.SOLVED
    assert again.point is not None
    np.testing.assert_allclose(again.point.z * unknowns, point.z, rtol=1e-8, atol=1e-9)
    if n == 8:
        none = LCP(M=-np.eye(n) * rows[:, None] * unknowns, q=-rows)
        proof = solver.run(none, budget)
        assert proof.claim is Claim.INFEASIBLE
        y = proof.certificate  # of powers of two, as the data: nothing rounds
        assert y is not None
        assert (y >= 0.0).all()
        assert (np.asarray(none.M).T @ y <= 0.0).all()
        assert none.q @ y < 0.0


@pytest.mark.parametrize("seed", range(40))
def test_contact_by_facets_with_redundant_contacts(seed: int) -> None:
    """Stewart and Trinkle's LCP (1996), copositive, W = HᵀH singular and q in its range: a solution exists."""
    rng = np.random.default_rng(seed)
    nc, directions = 8, 4
    H = rng.integers(-2, 3, (6, 3 * nc)) * 10.0 ** rng.uniform(-2, 2, (6, 1))
    J = np.zeros((3 * nc, nc * (1 + directions)))
    for c in range(nc):
        J[3 * c, c] = 1.0
        J[3 * c + 1, nc + c * directions : nc + (c + 1) * directions] = [1.0, 0.0, -1.0, 0.0]
        J[3 * c + 2, nc + c * directions : nc + (c + 1) * directions] = [0.0, 1.0, 0.0, -1.0]
    E = np.vstack([np.zeros((nc, nc)), np.kron(np.eye(nc), np.ones((directions, 1)))])
    mu = np.hstack([0.5 * np.eye(nc), np.zeros((nc, nc * directions))])
    K = H @ J
    M = np.block([[K.T @ K, E], [mu - E.T, np.zeros((nc, nc))]])
    problem = LCP(M=M, q=np.concatenate([K.T @ rng.integers(-3, 4, 6), np.zeros(nc)]))
    output = solvers.get("lemke").run(problem, Budget(tolerance=1e-8))
    assert output.claim is Claim.SOLVED, output.message
    assert judge(problem, output.point, 1e-8).solved
