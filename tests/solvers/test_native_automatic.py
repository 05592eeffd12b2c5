"""The automatic choices: an order from facts, the best answer handed on, and who solves it ends it."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from claims import assert_claim
from tiers import some_by_day

import cpbench
from cpbench.formulations import LCP, LCPPoint, Problem
from cpbench.proofs import certified_infeasible
from cpbench.solvers import Budget, Claim, solvers
from cpbench.testing.cases import cases
from cpbench.verification import judge
from cpbench_solvers.automatic import AutomaticChoice

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
                if member.obstacle(case.problem) is None:
                    other = member.run(case.problem, Budget(tolerance=1e-6, seconds=120.0))
                    assert other.claim is not Claim.SOLVED, f"{case.name}: {member.spec.name} solves it"


def test_size_and_structure_decide() -> None:
    small = LCP(M=np.eye(5), q=-np.ones(5))
    large = LCP(M=np.eye(500), q=-np.ones(500))
    grid = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(5000, 5000)).tocsr()
    upwind = sp.diags_array([-1.5, 2.0, -0.5], offsets=[-1, 0, 1], shape=(5000, 5000)).tocsr()
    assert order("auto-lcp", small)[0] == "lemke"
    assert order("auto-lcp", large)[0] == "bpp"
    assert order("auto-lcp", LCP(M=grid, q=-np.ones(5000)))[:2] == ["psor", "mprgp"]
    assert order("auto-lcp", LCP(M=upwind, q=-np.ones(5000)))[:2] == ["psor", "newton-min"]
    assert order("auto-lcp", LCP(M=grid[:500, :500], q=-np.ones(500)))[:3] == ["psor", "mprgp", "bpp"]


def test_sweeps_on_a_sparse_matrix_cost_no_more_than_to_store_it_as_a_dense_one() -> None:
    line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(300, 300)).tocsr()
    first, second, *_ = solvers.get("auto-lcp").phases(LCP(M=line, q=-np.ones(300)))
    assert first.iterations * line.nnz <= 300**2
    assert second.iterations * line.nnz <= 300**2


def test_a_failed_solver_is_followed_by_the_next_and_the_message_names_both() -> None:
    assert solvers.get("lemke").run(RAY).claim is Claim.FAILED
    assert solvers.get("newton-min").run(RAY).claim is not Claim.SOLVED
    found = solvers.get("auto-lcp").run(RAY)
    assert found.claim is Claim.SOLVED
    assert judge(RAY, found.point, 1e-6).solved
    assert found.counters["solvers"] == len(found.message.split("; ")) == 3
    assert found.message.startswith("lemke: ray")
    assert found.message.endswith("newton-fb: solved")


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
