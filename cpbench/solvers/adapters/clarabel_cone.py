"""Clarabel on quadratic programs over products of cones, called directly.

What Clarabel calls solved, almost solved or stuck is measured; if it is not good enough it gets a few Newton steps
(`cone_polish`, option `polish`), and the claim is about what was measured last.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench.formulations.coneqp import ConeQP
from cpbench.product_cones import Cone, ProductCone
from cpbench.solvers.adapters.cone_polish import polish
from cpbench.solvers.adapters.cone_program import ConeProgram, cone_program, obstacle
from cpbench.solvers.adapters.conic_models import ClarabelModel
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register


@dataclass(frozen=True)
class ClarabelConeOptions:
    """`polish` : the most Newton steps on an answer that is not good enough."""

    polish: int = 10


@register
class ClarabelCone(Solver):
    """Interior point on the homogeneous embedding with Nesterov–Todd scaling; every factor becomes Lorentz cones."""

    spec = SolverSpec(
        name="clarabel-cone",
        node="coneqp",
        summary="interior point on the homogeneous embedding, second-order and rolling cones, in Rust",
        method="interior point",
        citation="Goulart and Chen, Clarabel: an interior-point solver for conic programs, arXiv 2405.12762",
        requires=("clarabel",),
        install="pip install clarabel",
        licence="Apache-2.0",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
        options=ClarabelConeOptions,
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
        model = ClarabelModel(prepared.P, prepared.q, prepared.A, prepared.b, prepared.cones, budget)
        end = model.solve()
        claim, counters = end.claim, {"iterations": end.iterations}
        if not end.usable:
            claim = claim if claim in (Claim.INFEASIBLE, Claim.UNBOUNDED) else Claim.FAILED
            return SolverOutput(claim=claim, counters=counters, message=end.status)
        point = prepared.point(end.x, end.y)
        steps = options.polish if claim in (Claim.SOLVED, Claim.INACCURATE) else 0
        point, error, counters["polishing_steps"] = polish(prepared.problem, point, budget.tolerance, steps)
        if error <= budget.tolerance:
            claim = Claim.SOLVED
        elif claim is Claim.SOLVED:
            claim = Claim.INACCURATE
        return SolverOutput(claim=claim, point=point, counters=counters, message=f"{end.status}, error {error:.1e}")

    def warmup(self) -> None:
        K = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 0.5))
        self.run(ConeQP.over(np.eye(3), -np.ones(3), K))
