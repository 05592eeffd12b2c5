"""Automatic choice on MLCPs: pivoting where matrices are dense, the interior point where they are large and sparse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.linear import MLCP, MLCPPoint
from cpbench.foundation.matrices import is_sparse
from cpbench.solvers.base import Budget, SolverSpec, StackCall, register
from cpbench_solvers.automatic import Plan, SolverPhase, automatic_spec, ready
from cpbench_solvers.avi.apart import ByParts
from cpbench_solvers.mlcp.claims import scale
from cpbench_solvers.stacks import solve_mlcp

FEW = 100
"""Up to so many unknowns Lemke's method is done before connected parts are found."""
LARGE = 2000
"""Unknowns beyond which what takes sparse matrices apart in dense storage is asked last."""

ON_SMALL = tuple(
    SolverPhase(f"{method}-mlcp") for method in ("lemke", "newton-min", "newton-fb", "interior-point", "enumeration")
)


@register
class AutoMLCP(ByParts):
    """Lemke's method, which A may be singular for, or the interior point; Newton's method where they end in a ray.

    Of at most 20 pairs, all complementary bases are tried in the end: a solution is found if there is one.
    """

    spec: ClassVar[SolverSpec] = automatic_spec("mlcp", "auto-mlcp", "Lemke, Newton or interior point, by size")
    stack_call: ClassVar[StackCall | None] = StackCall(solve_mlcp)
    few: ClassVar[int] = FEW
    members: ClassVar[tuple[str, ...]] = tuple(phase.solver for phase in ON_SMALL)

    def error(self, problem: MLCP, point: MLCPPoint, tolerance: float) -> float:
        scaled = scale(problem, keep_sparse=True)
        return scaled.error(np.concatenate([point.u, point.v]) / scaled.unit, tolerance)

    def setup(self, problem: MLCP, budget: Budget, options: Any) -> Any:
        if not 0 < problem.a.size + problem.b.size <= FEW:
            return super().setup(problem, budget, options)
        # no question of the general way has another answer here, and to ask them all takes as long as such a problem
        solver, own = ready(ON_SMALL[0])
        return Plan(problem, ON_SMALL, solver.setup(problem, budget, own), own, solver)

    def phases(self, problem: MLCP) -> Sequence[SolverPhase]:
        lemke, minimum, fischer, interior, _ = ON_SMALL
        if not is_sparse(problem.A):
            return ON_SMALL
        if problem.a.size + problem.b.size > LARGE:
            return [interior, fischer, minimum, lemke]
        # a singular A is dear to eliminate in dense storage, which the factorization of A tells
        return [SolverPhase("lemke-mlcp", options={"tableau": False}), interior, lemke, minimum, fischer]
