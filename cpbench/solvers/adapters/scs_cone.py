"""SCS on quadratic programs over products of cones, called directly; the claim is about what was measured."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.formulations.coneqp import ConeQP
from cpbench.product_cones import Cone, ProductCone
from cpbench.solvers.adapters.cone_program import ConeProgram, cone_program, obstacle
from cpbench.solvers.adapters.conic_models import ScsModel
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register


@register
class ScsCone(Solver):
    """Douglas–Rachford splitting of the homogeneous embedding; every factor becomes Lorentz cones."""

    spec = SolverSpec(
        name="scs-cone",
        node="coneqp",
        summary="splitting of the homogeneous embedding (ADMM), second-order and rolling cones",
        method="ADMM",
        citation="O'Donoghue, Operator splitting for a homogeneous embedding of the LCP, SIAM J. Optim. 31 (2021)",
        requires=("scs",),
        install="pip install scs",
        licence="MIT",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
    )

    def obstacle(self, problem: ConeQP) -> str | None:
        return obstacle(problem)

    def setup(self, problem: ConeQP, budget: Budget, options: Any) -> ConeProgram:
        return cone_program(problem)

    def solve(
        self,
        prepared: ConeProgram,
        budget: Budget,
        options: Any,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        end = ScsModel(prepared.P, prepared.q, prepared.A, prepared.b, prepared.cones, budget).solve()
        claim, counters = end.claim, {"iterations": end.iterations}
        if not end.usable:
            claim = claim if claim in (Claim.INFEASIBLE, Claim.UNBOUNDED) else Claim.FAILED
            return SolverOutput(claim=claim, counters=counters, message=end.status)
        point = prepared.point(end.x, end.y)
        error = prepared.problem.residuals(point, budget.tolerance).error
        if error <= budget.tolerance:
            claim = Claim.SOLVED
        elif claim is Claim.SOLVED:
            claim = Claim.INACCURATE
        return SolverOutput(claim=claim, point=point, counters=counters, message=f"{end.status}, error {error:.1e}")

    def warmup(self) -> None:
        K = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 0.5))
        self.run(ConeQP.over(np.eye(3), -np.ones(3), K))
