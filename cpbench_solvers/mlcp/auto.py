"""Automatic choice on MLCPs: pivoting where matrices are dense, the interior point where they are large and sparse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from cpbench.formulations.linear import MLCP, MLCPPoint
from cpbench.foundation.matrices import is_sparse
from cpbench.solvers.base import SolverSpec, StackCall, register
from cpbench_solvers.automatic import SolverPhase, automatic_spec
from cpbench_solvers.avi.apart import ByParts
from cpbench_solvers.mlcp.claims import scale
from cpbench_solvers.stacks import solve_mlcp

FEW = 100
"""Up to so many unknowns Lemke's method is done before connected parts are found."""
LARGE = 2000
"""Unknowns beyond which what takes sparse matrices apart in dense storage is asked last."""


@register
class AutoMLCP(ByParts):
    """Lemke's method, which A may be singular for, or the interior point; Newton's method where they end in a ray.

    Of at most 20 pairs, all complementary bases are tried in the end: a solution is found if there is one.
    """

    spec: ClassVar[SolverSpec] = automatic_spec("mlcp", "auto-mlcp", "Lemke, Newton or interior point, by size")
    stack_call: ClassVar[StackCall | None] = StackCall(solve_mlcp)
    few: ClassVar[int] = FEW
    members: ClassVar[tuple[str, ...]] = (
        "lemke-mlcp",
        "newton-min-mlcp",
        "newton-fb-mlcp",
        "interior-point-mlcp",
        "enumeration-mlcp",
    )

    def error(self, problem: MLCP, point: MLCPPoint, tolerance: float) -> float:
        scaled = scale(problem, keep_sparse=True)
        return scaled.error(np.concatenate([point.u, point.v]) / scaled.unit, tolerance)

    def phases(self, problem: MLCP) -> Sequence[SolverPhase]:
        newton = [SolverPhase("newton-min-mlcp"), SolverPhase("newton-fb-mlcp")]
        if problem.a.size + problem.b.size > LARGE and is_sparse(problem.A):
            return [SolverPhase("interior-point-mlcp"), *reversed(newton), SolverPhase("lemke-mlcp")]
        return [SolverPhase("lemke-mlcp"), *newton, SolverPhase("interior-point-mlcp"), SolverPhase("enumeration-mlcp")]
