"""SCS on quadratic programs over products of cones, called directly; the claim is about what was measured."""

from __future__ import annotations

from typing import Any

from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.solvers.base import Budget, Claim, SolverSpec, Trait, register
from cpbench.solvers.stopping import Stopping
from cpbench_adapters.cone_program import ConeProgram
from cpbench_adapters.cone_solver import ConeSolver
from cpbench_adapters.conic_models import ConicModel, ScsModel


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
