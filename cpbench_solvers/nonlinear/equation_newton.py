"""Newton's method for systems of equations, smooth or piecewise so, made global by regularization and line search."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.equation import Equation, EquationPoint
from cpbench.formulations.qvi import QVI
from cpbench.formulations.vi import VI
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench.solvers.shared.row_error import LEAST
from cpbench_solvers.nonlinear.natural_newton import NaturalNewtonOptions, VIConditions
from cpbench_solvers.nonlinear.projection_run import exponential
from cpbench_solvers.nonlinear.vi_newton import NaturalMapSolver
from cpbench_solvers.traits import ITERATIVE


class _System(VIConditions):
    def row_error(self, x: Vector, F: Vector) -> float:
        """Return the largest error of a row; ∞ where F has no value once the unknowns that no row feels are 0: rows
        of a system may vanish on the way to a pole, as those of prices do."""
        error = super().row_error(x, F)
        slope = self.derivative(x)
        if slope is None or not x.size:
            return error
        felt = abs(slope).max(axis=0).toarray().ravel() * np.abs(x) >= LEAST
        return error if felt.all() or np.isfinite(self.F(np.where(felt, x, 0.0))).all() else math.inf

    def point(self, x: Vector) -> EquationPoint:
        return EquationPoint(x)


@register
class EquationNewton(NaturalMapSolver):
    """F(z) = 0 as an inequality over the whole space: Φ = F, d = −F′⁻¹F; εI added, Levenberg–Marquardt or
    extragradient steps where that does not descend or F or F′ is no number. Tolerance: on ‖F‖ and on every
    row, with a step or two beyond."""

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="newton-equation",
        node="equation",
        summary="damped Newton, regularized where the Jacobian is singular",
        method="Newton",
        citation="Dennis and Schnabel 1983, Numerical Methods for Unconstrained Optimization and Nonlinear Equations",
        traits=ITERATIVE,
        options=NaturalNewtonOptions,
    )

    conditions = _System

    def setup(self, problem: Any, budget: Budget, options: NaturalNewtonOptions) -> VI | QVI:
        return super().setup(VI(F=problem.F, start=problem.start), budget, options)

    def warmup(self) -> None:
        self.run(Equation(F=exponential()))
