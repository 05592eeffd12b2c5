"""Conic solvers on quadratic programs over products of cones, called directly; the claim is about what was measured.

What Clarabel calls solved, almost solved or stuck is measured; if it is not good enough it gets a few Newton steps
(`cpbench.solvers.shared.polish`, option `polish`), and the claim is about what was measured last.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.shared.polish import polish
from cpbench.solvers.stopping import Stopping
from cpbench_adapters.cone_program import ConeProgram, cone_program
from cpbench_adapters.conic_models import ClarabelModel, ConicModel, ScsModel


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
        if problem.p.size == 0:
            return "has no unknown (n = 0): there is nothing to minimise"
        if not problem.convex:
            least = matrices.least_eigenvalue(problem.Q)
            return f"not convex: Q has, at unit diagonal, the eigenvalue {least:.1e} or less"
        return None

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


@dataclass(frozen=True)
class ClarabelConeOptions:
    """Options of clarabel-coneqp. `polish` : the most Newton steps on an answer that is not good enough."""

    polish: int = 10


@register
class ClarabelCone(ConeSolver):
    """Interior point on the homogeneous embedding with Nesterov–Todd scaling; every factor becomes Lorentz cones."""

    spec = SolverSpec(
        name="clarabel-coneqp",
        node="coneqp",
        summary="interior point on the homogeneous embedding, second-order and rolling cones, in Rust",
        method="interior point",
        citation="Goulart and Chen, Clarabel: an interior-point solver for conic programs, arXiv 2405.12762",
        requires=("clarabel",),
        install="pip install clarabel",
        licence="Apache-2.0",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
        quick=True,
        options=ClarabelConeOptions,
    )

    def model(self, prepared: ConeProgram, budget: Budget) -> ConicModel:
        return ClarabelModel(prepared.P, prepared.q, prepared.A, prepared.b, prepared.cones, budget)

    def stopping(self, tolerance: float, problem: ConeQP | None = None) -> Stopping:
        return ClarabelModel.stopping(tolerance)

    def finish(
        self, problem: ConeQP, point: ConeQPPoint, claim: Claim, tolerance: float, options: Any
    ) -> tuple[ConeQPPoint, float, dict[str, int]]:
        steps = options.polish if claim in (Claim.SOLVED, Claim.INACCURATE) else 0
        point, error, done = polish(problem, point, tolerance, steps)
        return point, error, {"polishing_steps": done}


@register
class ScsCone(ConeSolver):
    """Douglas–Rachford splitting of the homogeneous embedding; every factor becomes Lorentz cones."""

    spec = SolverSpec(
        name="scs-coneqp",
        node="coneqp",
        summary="splitting of the homogeneous embedding (ADMM), second-order and rolling cones",
        method="ADMM",
        citation="O'Donoghue, Operator splitting for a homogeneous embedding of the LCP, SIAM J. Optim. 31 (2021)",
        requires=("scs",),
        install="pip install scs",
        licence="MIT",
        traits=frozenset({Trait.SPARSE, Trait.DETERMINISTIC}),
    )

    def model(self, prepared: ConeProgram, budget: Budget) -> ConicModel:
        return ScsModel(prepared.P, prepared.q, prepared.A, prepared.b, prepared.cones, budget)

    def stopping(self, tolerance: float, problem: ConeQP | None = None) -> Stopping:
        return ScsModel.stopping(tolerance)

    def finish(
        self, problem: ConeQP, point: ConeQPPoint, claim: Claim, tolerance: float, options: Any
    ) -> tuple[ConeQPPoint, float, dict[str, int]]:
        return point, problem.residuals(point, tolerance).error, {}
