"""Clarabel on quadratic programs over products of cones, called directly.

What Clarabel calls solved, almost solved or stuck is measured; if it is not good enough it gets a few Newton steps
(`native.cone.polish`, option `polish`), and the claim is about what was measured last.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.solvers.base import Budget, Claim, SolverSpec, Trait, register
from cpbench.solvers.shared.polish import polish
from cpbench.solvers.stopping import Stopping
from cpbench_adapters.cone_program import ConeProgram
from cpbench_adapters.cone_solver import ConeSolver
from cpbench_adapters.conic_models import ClarabelModel, ConicModel


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
