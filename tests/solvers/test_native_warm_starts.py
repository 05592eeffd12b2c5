"""Every native solver that takes a start: from its own answer it is done at once, and says so."""

from __future__ import annotations

import pytest
from tiers import some_by_day

from cpbench.solvers.base import Budget, Claim, Solver, Trait, solvers
from cpbench.testing import cases

MOST = 2
"""Iterations from its own answer; 0 where a solver looks at its start before it does anything."""
WARM = [s for s in solvers if type(s).__module__.startswith("cpbench_solvers.") and Trait.WARM_START in s.spec.traits]


@pytest.mark.parametrize("solver", some_by_day(WARM, 5), ids=lambda s: s.spec.name)
def test_from_its_own_answer_it_ends_at_once(solver: Solver) -> None:
    budget, tried, work = Budget(tolerance=1e-9, seconds=5.0, iterations=5000), 0, 0
    for case in cases(solver.spec.node):
        if solver.obstacle(case.problem) is not None:
            continue
        cold = solver.run(case.problem, budget)
        if cold.claim is not Claim.SOLVED:
            continue
        warm = solver.run(case.problem, budget, start=cold.point)
        assert warm.claim is Claim.SOLVED, case.name
        few = warm.counters["iterations"]
        assert few <= min(MOST, cold.counters["iterations"]), f"{case.name}: {few} iterations"
        tried, work = tried + 1, max(work, cold.counters["iterations"])
    assert tried
    assert work > 0, "no case needs an iteration"
