"""The plugin of a repository with a solver: what cpbench calls is here, the method in a module beside."""

from __future__ import annotations

from typing import Any, ClassVar

import sweeps

from cpbench.formulations import LCP, LCPPoint
from cpbench.foundation import matrices
from cpbench.solvers import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register


@register
class Mine(Solver):
    """Projected Gauss-Seidel, from the `sweeps` of this checkout."""

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="mine",
        node="lcp",
        summary="projected Gauss-Seidel",
        method="splitting",
        licence="MIT",
        traits=frozenset({Trait.DETERMINISTIC}),
    )

    def solve(
        self, prepared: LCP, budget: Budget, options: Any, start: LCPPoint | None = None, record: Record | None = None
    ) -> SolverOutput:
        z, count = sweeps.solve(matrices.dense(prepared.M), prepared.q, budget.tolerance)
        return SolverOutput(claim=Claim.SOLVED, point=LCPPoint(z=z), counters={"iterations": count})
