"""Automatic choice with rolling friction."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar, cast

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.local_contact import RollingFrictionContact
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput, SolverSpec, register, solvers
from cpbench_solvers.automatic import AutomaticChoice, Plan, SolverPhase, automatic_spec
from cpbench_solvers.contact.by_parts import SURE
from cpbench_solvers.contact.parts import at_hand, at_rest, error_or_rounding

ITERATIONS = 200
"""Iterations of ADMM in its first turn."""
SWEEPS, CONTACTS = 2.5, 100
"""Sweeps, or contacts swept where that is more (below 40 contacts), that take as long as an iteration of ADMM."""


@register
class AutoRolling(AutomaticChoice):
    """Sweeps and ADMM by turns of equal work."""

    spec: ClassVar[SolverSpec] = automatic_spec("rfc", "auto-rfc", "Gauss-Seidel and ADMM by turns")
    members: ClassVar[tuple[str, ...]] = ("nsgs-rfc", "admm-rfc")

    def error(self, problem: RollingFrictionContact, point: FCPoint, tolerance: float) -> float:
        norms = super().error(problem, point, tolerance)
        return max(norms, error_or_rounding(problem, point.r, SURE * tolerance))

    def phases(self, problem: RollingFrictionContact) -> Sequence[SolverPhase]:
        a_turn = max(SWEEPS, CONTACTS / max(problem.nc, 1))
        sweeps, admm = self.members
        return [SolverPhase(sweeps, int(a_turn * ITERATIONS)), SolverPhase(admm, ITERATIONS)]

    def setup(self, problem: Any, budget: Budget, options: Any) -> Any:
        return problem if at_rest(problem.q, problem.dimension) else super().setup(problem, budget, options)

    def solve(
        self, prepared: Any, budget: Budget, options: Any, start: Any = None, record: Record | None = None
    ) -> SolverOutput:
        if isinstance(prepared, RollingFrictionContact):
            return at_hand(FCPoint(np.zeros(prepared.q.size)), {"iterations": 0}, record)
        if prepared.first is None or start is not None or record is not None or budget.iterations is not None:
            return super().solve(prepared, budget, options, start, record)
        # most problems end in the first turn, small ones in less time than it takes to prepare for others
        deadline, (phase, *others), count = budget.deadline(), prepared.phases, prepared.phases[0].iterations or 0
        output = solvers.get(phase.solver).solve(prepared.first, replace(budget, iterations=count), prepared.options)
        if output.claim is Claim.SOLVED:
            counters = {**output.counters, "solvers": 1}
            return replace(output, counters=counters, message=f"{phase.solver}: solved")
        problem, point = cast(RollingFrictionContact, prepared.problem), output.point
        later = Plan(problem, (*others, phase))
        near = point is not None and self.error(problem, point, budget.tolerance) <= budget.tolerance**0.5
        if near:  # at this rate as many sweeps again are enough
            later = prepared._replace(phases=(replace(phase, iterations=2 * count), *others))
        rest = super().solve(later, budget.left(deadline), options, point, None)
        message = f"{phase.solver}: {output.message or output.claim}; {rest.message}"
        return replace(rest, counters=dict(Counter(output.counters) + Counter(rest.counters)), message=message)
