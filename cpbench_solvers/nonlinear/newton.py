"""Newton's method for systems of equations, smooth or piecewise so, made global by regularization and line search.

The same for variational and quasi-variational inequalities, with rows and g of any kind, by semismooth steps.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.nonlinear import EquationPoint
from cpbench.formulations.variational import QVI, VI
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, Record, SolverOutput, SolverSpec, register
from cpbench.solvers.shared.row_error import LEAST
from cpbench_solvers.nonlinear.natural_newton import NaturalNewton, NaturalNewtonOptions, VIConditions
from cpbench_solvers.nonlinear.projection_run import ProjectionSolver, run
from cpbench_solvers.traits import ITERATIVE


class NaturalMapSolver(ProjectionSolver):
    """Newton on the natural map of the optimality conditions. Tolerance: on that map, and on every row or factor."""

    method = NaturalNewton
    conditions: ClassVar[type[VIConditions]] = VIConditions

    def obstacle(self, problem: Any) -> str | None:
        return None

    def setup(self, problem: VI | QVI, budget: Budget, options: Any) -> VI | QVI:
        field = self.conditions(problem)
        x = np.concatenate([problem.start, np.zeros(field.size - field.n)])
        field.F(x)  # compiles it, and its derivative
        field.derivative(x)
        return problem

    def solve(
        self, prepared: VI | QVI, budget: Budget, options: Any, start: Any = None, record: Record | None = None
    ) -> SolverOutput:
        field = self.conditions(prepared)
        first = np.concatenate([prepared.start, np.zeros(field.size - field.n)])
        if start is not None:
            first = start.vector
        limit = budget.iterations or options.max_iterations
        return run(field, NaturalNewton(field, options, budget.seed), budget, limit, first, record)


_spec = partial(SolverSpec, method="semismooth Newton", traits=ITERATIVE, options=NaturalNewtonOptions)


@register
class VINewton(NaturalMapSolver):
    """Newton's method for inequalities over any set that the node has; converges globally where F is monotone."""

    spec: ClassVar[SolverSpec] = _spec(
        name="newton-vi",
        node="vi",
        summary="semismooth Newton on the natural map, extragradient steps where it does not descend",
        citation="Facchinei and Pang 2003, sections 9.1 and 12.1",
        quick=True,
    )


@register
class QVINewton(NaturalMapSolver):
    """Newton's method for sets that move: bounds, disks whose radius is a reaction, g(y, z) ≥ 0."""

    spec: ClassVar[SolverSpec] = _spec(
        name="newton-qvi",
        node="qvi",
        summary="semismooth Newton on the natural map of the moving set, extragradient steps where it does not descend",
        citation=(
            "Alart and Curnier 1991, Comput. Methods Appl. Mech. Eng. 92; Facchinei, Kanzow and Sagratella 2014, "
            "Math. Program. 144"
        ),
        quick=True,
    )


class _System(VIConditions):
    def row_error(self, x: Vector, F: Vector) -> float:
        """Return the largest error of a row; ∞ where F has no value once the unknowns that no row feels are 0: rows
        of a system may vanish on the way to a pole, as those of prices do."""
        error = super().row_error(x, F)
        slope = self.derivative(x)
        if slope is None or not x.size:
            return error
        active = abs(slope).max(axis=0).toarray().ravel() * np.abs(x) >= LEAST
        return error if active.all() or np.isfinite(self.F(np.where(active, x, 0.0))).all() else math.inf

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
