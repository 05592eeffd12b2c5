"""Josephy–Newton: linearize F, solve the complementarity problem that this gives, by any registered solver."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from cpbench.formulations.ncp_functions import fischer_burmeister
from cpbench.foundation.cones import box_defect, project_box
from cpbench.foundation.matrices import Matrix, Vector, norm
from cpbench.solvers.base import Budget, Solver, SolverSpec, Trait, register, solvers
from cpbench_solvers.inner import inner_solver
from cpbench_solvers.lcp.box_linear import NODES, BoxLinear
from cpbench_solvers.nonlinear.box_newton import DENSE_LIMIT, BoxMethod, BoxNewton, CountedBox
from cpbench_solvers.nonlinear.merit_search import MeritPoint, StepwiseDescent, fall_back
from cpbench_solvers.traits import ITERATIVE

SMALL_ENOUGH = 0.5
"""A solution of the linear problem is used when its natural residual is below this share of that of F at z."""
INNER_TOLERANCE = 1e-14
ITERATIONS, PIVOTS = 40, 5
"""Limit of an inner solver: 40 iterations from where it is linearized, or 40 + 5n pivots where it takes no start.
What takes longer is rarely a good direction."""
SEPARATOR = "+"


@dataclass(frozen=True)
class JosephyNewtonOptions:
    """Options of josephy-newton. `inner` : solver of the linear problems, of node lcp, mlcp or avi; several are
    joined by + and tried one after the other, those that keep a sparse matrix so before the others where it is one.
    `max_iterations` : linear problems. `memory` : merits that the line search compares with. `restarts` : other
    starts that are tried in the end."""

    inner: str = "lemke+newton-min"
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
        summary="Newton's method for generalized equations, linear problems by a registered LCP, MLCP or AVI solver",
        method="Josephy-Newton",
        citation="Josephy 1979, MRC report 1965; Facchinei and Pang 2003, section 7.3",
        traits=ITERATIVE,
        options=JosephyNewtonOptions,
    )

    def method(self, box: CountedBox, options: JosephyNewtonOptions, budget: Budget) -> BoxMethod:
        return _JosephyNewton(box, options, budget)

    def warmup(self) -> None:
        super().warmup()
        for name in JosephyNewtonOptions().inner.split(SEPARATOR):
            solvers.get(name).warmup()


class _JosephyNewton(StepwiseDescent):
    def __init__(self, box: CountedBox, options: JosephyNewtonOptions, budget: Budget) -> None:
        super().__init__(box, fischer_burmeister, options.memory, project=True)
        self._inner = [inner_solver(name.strip(), NODES) for name in options.inner.split(SEPARATOR)]
        if box.n > DENSE_LIMIT:
            self._inner.sort(key=lambda solver: Trait.SPARSE not in solver.spec.traits)
        self.strategies = len(self._inner)
        self._budget = replace(budget, tolerance=INNER_TOLERANCE)
        self._deadline = time.monotonic() + budget.seconds
        box.counters["subproblems"] = 0

    def begin(self, z: Vector, F: Vector, strategy: int) -> None:
        """Begin; the strategies differ in which inner solver is asked first."""
        self._turn = self._inner[strategy:] + self._inner[:strategy]
        super().begin(z, F, strategy)

    def next(self, J: Matrix, gradient: Vector) -> MeritPoint | None:
        for solver in self._turn:
            target = self._linear_solution(J, solver)
            if target is not None:
                d = target - self.at.z
                result = self.descent.search(self.at, d, float(gradient @ d))
                if result is not None:
                    return result
        return fall_back(self.descent, self.at, J, gradient)

    def _linear_solution(self, J: Matrix, solver: Solver) -> Vector | None:
        """Return z⁺ within the bounds, None where the solver finds none."""
        box, at = self.box, self.at
        box.counters["subproblems"] += 1
        left = max(self._deadline - time.monotonic(), 0.1) if math.isfinite(self._deadline) else math.inf
        q = at.F - J @ at.z
        linear = BoxLinear(J, q, box.lb, box.ub, at.z)
        most = ITERATIONS + (0 if Trait.WARM_START in solver.spec.traits else PIVOTS * box.n)
        z = linear.solve(solver, replace(self._budget, seconds=left, iterations=most))
        if z is None:
            return None
        with np.errstate(all="ignore"):
            z = project_box(z, box.lb, box.ub)
            defect = norm(box_defect(z, J @ z + q, box.lb, box.ub))
            now = norm(box_defect(at.z, at.F, box.lb, box.ub))
        return z if defect <= SMALL_ENOUGH * now else None
