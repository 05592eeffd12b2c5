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


@pytest.mark.parametrize("kind", KINDS)
def test_hundreds_of_unknowns(kind: str) -> None:
    problem, _ = planted.lcp(np.random.default_rng(1), 400, kind)
    output = solvers.get("lemke").run(problem, Budget(tolerance=1e-9))
    assert output.claim is Claim.SOLVED, output.message


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


@pytest.mark.parametrize("kind", KINDS)
def test_the_principal_transform_exchanges_w_and_z(kind: str) -> None:
    """w' = M'z' + q' says of every z what w = Mz + q says of it, z' and w' having w_B and z_B exchanged."""
    rng = np.random.default_rng(7)
    problem, _ = planted.lcp(rng, 9, kind)
    inside = np.arange(9) % 3 == 1
    seen = transformed(dense_lcp(problem), inside)
    assert seen is not None
    columns = -seen.negated_columns(np.arange(9)).T
    z = rng.standard_normal(9)
    w = problem.M @ z + problem.q
    w_unit, z_unit = np.abs(problem.q).max(), np.abs(seen.lifted(np.ones(9), np.ones(9))).max()
    others = np.where(inside, w / w_unit, z / z_unit)
    expected = np.where(inside, z / z_unit, w / w_unit)
    np.testing.assert_allclose(columns @ others + seen.q, expected, rtol=1e-8, atol=1e-9 * np.abs(expected).max())


def test_no_transform_in_a_singular_basis() -> None:
    problem = LCP(M=np.ones((3, 3)), q=-np.ones(3))
    assert transformed(dense_lcp(problem), np.array([True, True, False])) is None


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [12, 60])
def test_a_start_near_the_answer_saves_pivots(kind: str, n: int) -> None:
    """One component on the wrong side: what is found is a solution, and after fewer pivots in all."""
    solver, saved = solvers.get("lemke"), 0
    for seed in range(5):
        problem, _ = planted.lcp(np.random.default_rng(seed), n, kind)
        cold = solver.run(problem, Budget(tolerance=1e-9))
        assert cold.claim is Claim.SOLVED
        assert cold.point is not None
        z = np.array(cold.point.z)
        z[np.argmax(z)] = 0.0
        warm = solver.run(problem, Budget(tolerance=1e-9), start=LCPPoint(z=z))
        assert judge(problem, warm.point, 1e-9).solved
        saved += cold.counters["pivots"] - warm.counters["pivots"]
        again = solver.run(problem, Budget(tolerance=1e-9), start=cold.point)
        assert again.counters["pivots"] == 0
    assert saved > 0


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


def test_infeasible_whatever_the_start() -> None:
    """A transformed problem ends in a ray too; the proof comes from the plain run."""
    problem = LCP(M=np.array([[0.0, 1.0], [-1.0, 0.0]]), q=np.array([-1.0, -1.0]))
    output = solvers.get("lemke").run(problem, start=LCPPoint(z=np.array([1.0, 1.0])))
    assert output.claim is Claim.INFEASIBLE
    assert problem.certifies_infeasibility(output.certificate)


@pytest.mark.parametrize("sweeps", [0, 20])
def test_nothing_to_do_on_a_large_problem(sweeps: int) -> None:
    problem = LCP(M=np.eye(260), q=np.ones(260))
    output = solvers.get("lemke").run(problem, None, lemke_run.LemkeOptions(crash_sweeps=sweeps))
    assert output.claim is Claim.SOLVED
    assert output.point is not None
    assert not output.point.z.any()


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


@pytest.mark.parametrize("seed", range(20))
def test_bimatrix_games_are_solved_beyond_the_ray(seed: int) -> None:
    """Every covering vector ends in a ray after one pivot (Cottle, Pang and Stone 1992, section 4.4)."""
    rng = np.random.default_rng(seed)
    m, n = (int(k) for k in rng.integers(1, 40, 2))
    costs = rng.integers(1, 6, (2, m, n)) if seed % 2 else rng.uniform(1.0, 2.0, (2, m, n))
    M = np.block([[np.zeros((m, m)), costs[0]], [costs[1].T, np.zeros((n, n))]])
    problem = LCP(M=M, q=-np.ones(m + n))
    output = solvers.get("lemke").run(problem, Budget(tolerance=1e-9))
    assert output.claim is Claim.SOLVED, output.message
    assert judge(problem, output.point, 1e-9).solved


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
