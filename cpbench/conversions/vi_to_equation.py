"""VI → equations, X = ℝⁿ (equations (22) and (31)).

Source  F(z)ᵀ(y − z) ≥ 0 for all y ∈ ℝⁿ.
Target  F(z) = 0.
Lift    z.        Push  z.
Kind    equivalent: y = z − F(z) in the inequality gives F(z) = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.equation import Equation, EquationPoint
from cpbench.formulations.variational import VIPoint
from cpbench.formulations.vi import VI
from cpbench.foundation.product_cones import Cone


@conversions.register("vi-equation")
@dataclass(frozen=True)
class VItoEquation(Conversion):
    """A variational inequality with nothing to hold z back. Trace: empty."""

    name = "vi-equation"
    source = "vi"
    target = "equation"
    equation = "(22) → (31)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: VI) -> str | None:
        rows = problem.b.size + problem.d.size + problem.g.rows
        bounds = int((np.isfinite(problem.lb) | np.isfinite(problem.ub)).sum())
        factors = int((problem.K.kind != Cone.FREE).sum())
        if not (rows or bounds or factors):
            return None
        return (
            f"X is not ℝⁿ: {bounds} components with bounds, {factors} factors that are not ℝ, {rows} rows; use vi-micp"
        )

    def apply(self, problem: VI) -> tuple[Equation, Trace]:
        self.require(problem)
        return Equation(F=problem.F, start=problem.start), {}

    def lift(self, point: EquationPoint, trace: Trace) -> VIPoint:
        return VIPoint(z=point.z)

    def push(self, point: VIPoint, trace: Trace) -> EquationPoint:
        return EquationPoint(z=point.z)
