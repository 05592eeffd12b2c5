"""The automatic choices: an order from facts, the best answer handed on, and who solves it ends it."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import pytest
import scipy.sparse as sp
from claims import assert_claim
from tiers import some_by_day

import cpbench
from cpbench.formulations import AVI, LCP, MLCP, AVIPoint, LCPPoint, Problem
from cpbench.proofs import certified_infeasible
from cpbench.solvers import Budget, Claim, Solver, SolverOutput, SolverSpec, solvers
from cpbench.solvers.base import solved
from cpbench.testing.cases import cases
from cpbench.verification import judge
from cpbench_solvers.automatic import AutomaticChoice, automatic_spec
from cpbench_solvers.avi.as_mlcp import as_mlcp
from cpbench_solvers.traits import ITERATIVE

CHOICES = [name for name in solvers.names() if isinstance(solvers.get(name), AutomaticChoice)]
RAY = LCP(M=np.array([[-3.0, 2.0, -1.0], [1.0, 0.0, 3.0], [3.0, 2.0, -2.0]]), q=np.array([2.0, 2.0, -1.0]))
"""Drawn from integers: it has solutions, Lemke's method ends in rays, and Newton's on min stops elsewhere."""


def order(name: str, problem: Problem) -> list[str]:
    choice = solvers.get(name)
    assert isinstance(choice, AutomaticChoice)
    return [phase.solver for phase in choice.phases(problem)]


@pytest.mark.parametrize("name", some_by_day(CHOICES, 6))
def test_a_choice_solves_what_a_member_solves(name: str) -> None:
    """On the planted cases; what no member solves, it does not solve either, and says so."""
    choice = solvers.get(name)
    assert isinstance(choice, AutomaticChoice)
    for case in cases(choice.spec.node):
        found = choice.run(case.problem, Budget(tolerance=1e-6, seconds=120.0))
        if found.claim is Claim.SOLVED:
            assert_claim(case.problem, found.point, 1e-6)
        else:
            solved = found.point is not None and judge(case.problem, found.point, 1e-6).solved
            assert not solved, f"{case.name}: {found.message}"
            for member in map(solvers.get, choice.members):
                if member.spec.node == choice.spec.node and member.obstacle(case.problem) is None:
                    other = member.run(case.problem, Budget(tolerance=1e-6, seconds=120.0))
                    assert other.claim is not Claim.SOLVED, f"{case.name}: {member.spec.name} solves it"


def test_size_and_structure_decide() -> None:
    small = LCP(M=np.eye(5), q=-np.ones(5))
    large = LCP(M=np.eye(500), q=-np.ones(500))
    grid = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(5000, 5000)).tocsr()
    upwind = sp.diags_array([-1.5, 2.0, -0.5], offsets=[-1, 0, 1], shape=(5000, 5000)).tocsr()
    assert order("auto-lcp", small)[0] == "lemke"
    assert order("auto-lcp", large)[0] == "bpp"
    assert order("auto-lcp", LCP(M=grid, q=-np.ones(5000)))[:2] == ["mprgp", "newton-min"]
    assert order("auto-lcp", LCP(M=upwind, q=-np.ones(5000)))[:2] == ["psor", "newton-min"]
    assert order("auto-lcp", LCP(M=grid[:500, :500], q=-np.ones(500)))[:2] == ["mprgp", "bpp"]
    game = np.kron([[0.0, 1.0], [1.0, 0.0]], np.ones((150, 150)))
    assert order("auto-lcp", LCP(M=game, q=-np.ones(300)))[:2] == ["lemke", "bpp"]


def test_products_with_a_sparse_matrix_cost_no_more_than_to_pivot_on_a_dense_one() -> None:
    line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(300, 300)).tocsr()
    first = solvers.get("auto-lcp").phases(LCP(M=line, q=-np.ones(300)))[0]
    assert 2 * 300**2 < first.iterations * line.nnz <= 4 * 300**2


@pytest.mark.parametrize("singular", [False, True])
def test_free_unknowns_whose_matrix_is_singular_are_for_the_interior_point_where_it_is_sparse(singular: bool) -> None:
    """A chain of 60 of them; A = 0, they are the multipliers of as many equations. The answers are planted."""
    rng, n = np.random.default_rng(3), 60
    line = sp.diags_array([-1.0, 2.5, -1.0], offsets=[-1, 0, 1], shape=(n, n)).tocsr()
    half, eye = np.arange(n) % 2, sp.eye_array(n, format="csr")
    u, v, w = rng.standard_normal(n), half * rng.uniform(1.0, 2.0, n), (1 - half) * rng.uniform(1.0, 2.0, n)
    A = sp.csr_array((n, n)) if singular else line
    problem = MLCP(A=A, C=-eye, D=eye, B=line, a=v - A @ u, b=w - u - line @ v)
    found = solvers.get("auto-mlcp").run(problem, Budget(tolerance=1e-8))
    assert found.message.endswith("interior-point-mlcp: solved" if singular else "lemke-mlcp: solved")
    np.testing.assert_allclose(found.point.v, v, atol=1e-6)


def test_a_failed_solver_is_followed_by_the_next_and_the_message_names_both() -> None:
    assert solvers.get("lemke").run(RAY).claim is Claim.FAILED
    assert solvers.get("newton-min").run(RAY).claim is not Claim.SOLVED
    found = solvers.get("auto-lcp").run(RAY)
    assert found.claim is Claim.SOLVED
    assert judge(RAY, found.point, 1e-6).solved
    assert found.counters["solvers"] == 6
    assert found.message.startswith("lemke: ray")
    assert found.message.endswith("enumeration-lcp: solved")


class Slow(Solver):
    """A member that needs more iterations than its first turn has, and says in `seen` where each of its turns began."""

    spec = SolverSpec(name="slow-lcp", node="lcp", summary="", method="projection", traits=ITERATIVE)
    seen: ClassVar[list[tuple[int, float]]] = []

    def solve(self, prepared, budget, options, start=None, record=None) -> SolverOutput:
        made, begun = budget.iterations, 0.0 if start is None else float(start.z[0])
        type(self).seen.append((made, begun))
        z = np.array([1.0 - (1.0 - begun) * 0.9999**made])
        if 1.0 - z[0] < 1e-6:
            return solved(LCPPoint(np.ones(1)), {"iterations": made})
        return SolverOutput(claim=Claim.MAX_ITER, point=LCPPoint(z), counters={"iterations": made})


class Stuck(Slow):
    """A member that comes nowhere, however long it goes on."""

    spec = SolverSpec(name="stuck-lcp", node="lcp", summary="", method="semismooth Newton", traits=ITERATIVE)
    turns: ClassVar[list[int]] = []

    def solve(self, prepared, budget, options, start=None, record=None) -> SolverOutput:
        type(self).turns.append(budget.iterations)
        return SolverOutput(
            claim=Claim.MAX_ITER, point=LCPPoint(np.zeros(1)), counters={"iterations": budget.iterations}
        )


def test_turns_double_and_each_member_goes_on_from_where_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    """No member waits for the end of another one, and none starts again from a point that is hardly better."""

    class Choice(AutomaticChoice):
        spec = automatic_spec("lcp", "two-lcp", "a slow member and one that is stuck")
        members = ("stuck-lcp", "slow-lcp")

    for member in (Stuck, Slow):
        monkeypatch.setitem(solvers._items, member.spec.name, member())
    found = Choice().run(LCP(M=np.eye(1), q=-np.ones(1)))
    assert found.claim is Claim.SOLVED
    lengths = [1000 * 2**turn for turn in range(8)]
    assert [made for made, _ in Slow.seen] == lengths
    assert Stuck.turns == [made // 20 for made in lengths]
    assert [begun for _, begun in Slow.seen] == sorted({begun for _, begun in Slow.seen})
    assert found.counters["solvers"] == 2


def test_a_problem_in_a_box_is_solved_as_its_mixed_lcp_and_back() -> None:
    """Unknowns of all kinds: free, above, below, between, fixed; rows and equalities; its solution is planted."""
    rng, inf = np.random.default_rng(7), np.inf
    kinds = np.array([[-inf, inf], [0.5, inf], [-inf, -0.5], [-1.0, 2.0], [0.25, 0.25]] * 4)
    z = np.clip(rng.standard_normal(20), *kinds.T)
    M, A, C = rng.standard_normal((20, 20)), rng.standard_normal((3, 20)), rng.standard_normal((2, 20))
    lam, mu = np.array([1.0, 0.0, 0.0]), np.array([0.5, -2.0])
    force = rng.uniform(0.5, 1.0, 20) * ((z == kinds[:, 0]) * 1.0 - (z == kinds[:, 1]))
    M = M @ M.T + M - M.T
    q = force - M @ z + A.T @ lam + C.T @ mu
    problem = AVI(M=M, q=q, A=A, b=A @ z - (lam == 0), C=C, d=C @ z, lb=kinds[:, 0], ub=kinds[:, 1])
    neighbour, point = as_mlcp(problem), AVIPoint(z, lam, mu)
    there = neighbour.push(point)
    assert judge(neighbour.problem, there, 1e-9).solved
    back = neighbour.lift(there)
    assert all(
        np.allclose(x, y, atol=1e-12) for x, y in zip(back.arrays().values(), point.arrays().values(), strict=True)
    )
    found = neighbour.lift(solvers.get("lemke-mlcp").run(neighbour.problem).point)
    assert judge(problem, found, 1e-9).solved
    assert np.allclose(found.z, z, atol=1e-9)


def test_a_linear_program_as_mixed_complementarity_is_solved_to_rounding() -> None:
    """M is singular on the lines of the box: the multipliers of equalities are free (v48_small of a public report)."""
    problem = AVI(
        M=np.array([[0.0, 0.0, -1.0], [0.0, 0.0, -1.0], [1.0, 1.0, 0.0]]), q=np.array([1.0, 2.0, -3.0]),
        lb=np.array([0.0, 0.0, -np.inf]), ub=np.array([2.0, np.inf, np.inf]),
    )  # fmt: skip
    found = cpbench.solve(problem)
    assert found.status == "solved"
    assert found.point.z.tolist() == [2.0, 1.0, 2.0]


def test_a_proof_that_there_is_no_solution_ends_it() -> None:
    problem = LCP(M=np.array([[0.0, 0.0], [0.0, 1.0]]), q=np.array([-1.0, 1.0]))
    found = solvers.get("auto-lcp").run(problem)
    assert found.claim is Claim.INFEASIBLE
    assert found.certificate is not None
    assert certified_infeasible(problem, found.certificate)
    assert found.counters["solvers"] == 1


def test_a_start_that_is_a_solution_is_the_answer() -> None:
    problem = LCP(M=np.array([[2.0, 1.0], [1.0, 2.0]]), q=np.array([-3.0, -3.0]))
    start = LCPPoint(z=np.array([1.0, 1.0]))
    seen: list[int] = []
    found = solvers.get("auto-lcp").run(problem, start=start, record=lambda k, _, point: seen.append(k))
    assert found.claim is Claim.SOLVED
    assert found.point is start
    assert found.counters == {"iterations": 0, "solvers": 0}
    assert seen == [0]


def test_a_subnormal_entry_ends_in_no_error() -> None:
    """1/1e-309 is no number; (2e307, 0.03) is the solution, so that nothing may be proved."""
    found = cpbench.solve(LCP(M=np.diag([1e-309, 1.0]), q=np.array([-0.02, -0.03])))
    assert found.status in ("solved", "failed"), found
