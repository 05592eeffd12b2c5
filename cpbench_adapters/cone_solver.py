"""Conic solvers on quadratic programs over products of cones, called directly; the claim is about what was measured."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np

from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput
from cpbench_adapters.cone_program import ConeProgram, cone_program, obstacle
from cpbench_adapters.conic_models import ConicModel


class ConeSolver(Solver):
    """One conic solver; every factor becomes Lorentz cones."""

    @abstractmethod
    def model(self, prepared: ConeProgram, budget: Budget) -> ConicModel:
        """Return the solver's model of the program."""

    @abstractmethod
    def finish(
        self, problem: ConeQP, point: ConeQPPoint, claim: Claim, tolerance: float, options: Any
    ) -> tuple[ConeQPPoint, float, dict[str, int]]:
        """Return the answer in the end, its judged error, and what was counted on the way to it."""

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
        end = self.model(prepared, budget).solve()
        claim, counters = end.claim, {"iterations": end.iterations}
        if not end.usable:
            claim = claim if claim in (Claim.INFEASIBLE, Claim.UNBOUNDED) else Claim.FAILED
            return SolverOutput(claim=claim, counters=counters, message=end.status)
        point, error, more = self.finish(
            prepared.problem, prepared.point(end.x, end.y), claim, budget.tolerance, options
        )
        if error <= budget.tolerance:
            claim = Claim.SOLVED
        elif claim is Claim.SOLVED:
            claim = Claim.INACCURATE
        message = f"{end.status}, error {error:.1e}"
        return SolverOutput(claim=claim, point=point, counters={**counters, **more}, message=message)

    def warmup(self) -> None:
        K = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 0.5))
        self.run(ConeQP.over(np.eye(3), -np.ones(3), K))
