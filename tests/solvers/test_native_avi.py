"""Pivoting between bounds and from vertices: against enumeration, published games, on degenerate and empty sets."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import planted_conic
import pytest

from cpbench.formulations import AVI, Relay
from cpbench.solvers import Budget, Claim, solvers
from cpbench.verification import judge
from cpbench_solvers.avi.polyhedron_vertex import ScaledPolyhedron

TIGHT = Budget(tolerance=1e-10)


def enumerated(M: np.ndarray, q: np.ndarray, lb: np.ndarray, ub: np.ndarray) -> list[np.ndarray]:
    """All solutions of a relay problem: every unknown at its lower bound, at its upper bound, or w = 0."""
    found = []
    for state in itertools.product((-1, 0, 1), repeat=q.size):
        s = np.array(state)
        free = s == 0
        z = np.where(s < 0, lb, ub)
        z[free] = np.linalg.solve(M[np.ix_(free, free)], -(q + M[:, ~free] @ z[~free])[free])
        w = M @ z + q
        inside = (z[free] >= lb[free] - 1e-12).all() and (z[free] <= ub[free] + 1e-12).all()
        if inside and (w[s < 0] >= -1e-12).all() and (w[s > 0] <= 1e-12).all():
            found.append(z)
    return found


@pytest.mark.parametrize("seed", range(40))
def test_the_path_ends_where_enumeration_finds_a_solution(seed: int) -> None:
    """Any M, up to five unknowns; a box is bounded, so that there is always a solution and no ray."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    M, q = 2.0 * rng.standard_normal((n, n)), 2.0 * rng.standard_normal(n)
    problem = Relay(M=M, q=q, lb=-np.ones(n), ub=rng.uniform(0.0, 2.0, n))
    output = solvers.get("lemke-relay").run(problem, TIGHT)
    assert output.claim is Claim.SOLVED, output.message
    all_of_them = enumerated(M, q, problem.lb, problem.ub)
    assert min(np.abs(output.point.z - z).max() for z in all_of_them) < 1e-9


@pytest.mark.parametrize("kind", ["positive definite", "singular semidefinite", "monotone"])
@pytest.mark.parametrize("sparse", [False, True])
def test_polyhedra_with_every_kind_of_row_and_bound(kind: str, sparse: bool) -> None:
    """Rows, equalities, free, half bounded and fixed unknowns; to ten digits."""
    for seed in range(12):
        rng = np.random.default_rng(seed)
        problem, _ = planted_conic.avi(rng, 25, int(rng.integers(0, 15)), int(rng.integers(0, 8)), kind, sparse=sparse)
        output = solvers.get("lemke-avi").run(problem, TIGHT)
        assert output.claim is Claim.SOLVED, f"{seed}: {output.message}"
        assert judge(problem, output.point, TIGHT.tolerance).solved


def test_as_many_pivots_as_unknowns_change() -> None:
    """Bounds cost no rows: M = I, each unknown is between its bounds, or at one, after at most two steps."""
    n = 50
    problem = Relay(M=np.eye(n), q=np.linspace(-2.0, 2.0, n), lb=-np.ones(n), ub=np.ones(n))
    output = solvers.get("lemke-relay").run(problem, TIGHT)
    np.testing.assert_allclose(output.point.z, np.clip(-problem.q, -1.0, 1.0), atol=1e-14)
    assert output.counters["iterations"] <= 2 * n


def test_a_warm_start_is_a_basis(rng: np.random.Generator) -> None:
    """From its own answer nothing is left to do; a little beside the old data, fewer pivots than from a vertex."""
    problem, _ = planted_conic.avi(rng, 40, 15, 5, "positive definite")
    solver = solvers.get("lemke-avi")
    cold = solver.run(problem, TIGHT)
    assert solver.run(problem, TIGHT, start=cold.point).counters["iterations"] == 0
    moved = dataclasses.replace(problem, q=problem.q + 1e-4 * rng.standard_normal(40))
    warm, afresh = (solver.run(moved, TIGHT, start=s) for s in (cold.point, None))
    assert warm.claim is afresh.claim is Claim.SOLVED
    assert warm.counters["iterations"] < afresh.counters["iterations"]


def test_degenerate_vertices_do_not_cycle() -> None:
    """A pyramid of many faces with its top at the solution, every row twice, as rows and as equalities."""
    angle = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
    A = np.column_stack([np.cos(angle), np.sin(angle), -np.ones(24)])
    A = np.vstack([A, A])
    problem = AVI(M=np.eye(3), q=np.array([0.0, 0.0, 5.0]), A=-A, b=np.zeros(48), ub=np.array([np.inf, np.inf, 4.0]))
    output = solvers.get("lemke-avi").run(problem, TIGHT)
    assert output.claim is Claim.SOLVED, output.message
    np.testing.assert_allclose(output.point.z, 0.0, atol=1e-10)


def test_matching_pennies() -> None:
    """The mixed equilibrium (½, ½), (½, ½) of a zero-sum game, an AVI over two simplices with a skew M of rank 2."""
    payoff = np.array([[1.0, -1.0], [-1.0, 1.0]])
    zero = np.zeros((2, 2))
    problem = AVI(
        M=np.block([[zero, payoff], [-payoff.T, zero]]),
        q=np.zeros(4),
        C=np.kron(np.eye(2), np.ones((1, 2))),
        d=np.ones(2),
        lb=np.zeros(4),
    )
    output = solvers.get("lemke-avi").run(problem, TIGHT)
    assert output.claim is Claim.SOLVED, output.message
    np.testing.assert_allclose(output.point.z, 0.5, atol=1e-12)


def test_lines_that_M_does_not_hold_are_reported() -> None:
    problem = AVI(M=np.zeros((2, 2)), q=np.zeros(2), A=np.array([[1.0, 0.0]]), b=np.zeros(1))
    assert "lines" in solvers.get("lemke-avi").run(problem, TIGHT).message


def test_a_vertex_has_as_many_conditions_as_unknowns(rng: np.random.Generator) -> None:
    """Independent ones: N unknowns between bounds, |J| + |E| rows that fix them."""
    for seed in range(20):
        problem, _ = planted_conic.avi(np.random.default_rng(seed), 12, 9, 3)
        moving = problem.moving
        shift = np.where(moving, 0.0, problem.lb)
        A, C = problem.A[:, moving], problem.C[:, moving]
        b, d = problem.b - problem.A @ shift, problem.d - problem.C @ shift
        found = ScaledPolyhedron(A, b, C, d, problem.lb[moving], problem.ub[moving])
        z = found.vertex(rng.standard_normal(int(moving.sum())))
        assert z is not None
        N, J, E = found.basis(z)
        rows = np.vstack([A[J][:, N], C[E][:, N]])
        assert np.linalg.matrix_rank(rows) == min(rows.shape)
        assert (A @ z - b).min(initial=0.0) > -1e-8
        np.testing.assert_allclose(C @ z, d, atol=1e-8)
