"""Josephy–Newton: linearize F, solve the affine variational inequality that this gives, by any registered solver."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from cpbench.errors import CpbenchError
from cpbench.formulations.linear import AVI, AVIPoint
from cpbench.formulations.ncp_functions import fischer_burmeister
from cpbench.foundation.cones import box_defect, project_box
from cpbench.foundation.matrices import Matrix, Vector, norm
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_solvers.inner import inner_solver
from cpbench_solvers.nonlinear.box_newton import BoxMethod, BoxNewton, CountedBox
from cpbench_solvers.nonlinear.merit_search import MeritPoint, StepwiseDescent, fall_back
from cpbench_solvers.traits import ITERATIVE

SMALL_ENOUGH = 0.5
"""A solution of the linear problem is used when its natural residual is below this share of that of F at z."""
INNER_TOLERANCE = 1e-14
ITERATIONS, PIVOTS = 40, 5
"""Limit of an inner solver, 40 + 5n iterations or pivots: what takes longer is rarely a good direction."""


@dataclass(frozen=True)
class JosephyNewtonOptions:
    """Options of josephy-newton. `inner` : solver of the linear problems, of node avi. `max_iterations` : linear
    problems. `memory` : merits that the line search compares with. `restarts` : other starts that are tried in the
    end."""

    inner: str = "lemke-avi"
    max_iterations: int = 500
    memory: int = 5
    restarts: int = 20


@register
class JosephyNewton(BoxNewton):
    """z⁺ solves −(F(z) + F′(z)(z⁺ − z)) ∈ N_[lb,ub](z⁺): quadratic convergence to strongly regular solutions.

    A step must lower the Fischer–Burmeister merit, nonmonotonely; where the linear problem has no solution or its
    direction does not descend, a Levenberg–Marquardt step or a gradient step of that merit is taken.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="josephy-newton",
        node="micp",
        summary="Newton's method for generalized equations, linear problems by a registered AVI solver",
        method="Josephy-Newton",
        citation="Josephy 1979, MRC report 1965; Facchinei and Pang 2003, section 7.3",
        traits=ITERATIVE,
        options=JosephyNewtonOptions,
    )

    def method(self, box: CountedBox, options: JosephyNewtonOptions, budget: Budget) -> BoxMethod:
        return _JosephyNewton(box, options, budget)


class _JosephyNewton(StepwiseDescent):
    def __init__(self, box: CountedBox, options: JosephyNewtonOptions, budget: Budget) -> None:
        super().__init__(box, fischer_burmeister, options.memory, project=True)
        self._inner = inner_solver(options.inner, ("avi",))
        self._budget = replace(budget, tolerance=INNER_TOLERANCE)
        self._deadline = time.monotonic() + budget.seconds
        box.counters["subproblems"] = 0

    def next(self, J: Matrix, gradient: Vector) -> MeritPoint | None:
        target = self._linear_solution(J)
        if target is not None:
            d = target - self.at.z
            result = self.descent.search(self.at, d, float(gradient @ d))
            if result is not None:
                return result
        return fall_back(self.descent, self.at, J, gradient)

    def _linear_solution(self, J: Matrix) -> Vector | None:
        """Return z⁺ within the bounds, None where the solver finds none."""
        box, at, solver = self.box, self.at, self._inner
        box.counters["subproblems"] += 1
        left = max(self._deadline - time.monotonic(), 0.1) if math.isfinite(self._deadline) else math.inf
        q = at.F - J @ at.z
        most = ITERATIONS + PIVOTS * box.n
        try:
            linear = AVI(M=J, q=q, lb=box.lb, ub=box.ub)
            if solver.obstacle(linear) is not None:
                return None
            point = solver.run(linear, replace(self._budget, seconds=left, iterations=most), start=AVIPoint(at.z)).point
        except (CpbenchError, np.linalg.LinAlgError):
            return None
        if point is None or not point.finite:
            return None
        with np.errstate(all="ignore"):
            z = project_box(point.z, box.lb, box.ub)
            defect = norm(box_defect(z, J @ z + q, box.lb, box.ub))
            now = norm(box_defect(at.z, at.F, box.lb, box.ub))
        return z if defect <= SMALL_ENOUGH * now else None
