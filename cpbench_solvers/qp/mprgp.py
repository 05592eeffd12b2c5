"""Conjugate gradients on faces of a box (MPRGP), for convex quadratic programs whose only constraints are bounds."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.programs import QP, QPPoint
from cpbench.foundation.cones import project_box
from cpbench.foundation.matrices import Vector, max_abs
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, register
from cpbench_solvers import linear_program
from cpbench_solvers.lcp.claims import CLOSE
from cpbench_solvers.lcp.mprgp import MPRGPOptions, ScaledBox, definite_obstacle, minimize, scaled_box
from cpbench_solvers.qp.claims import ErrorMeasure
from cpbench_solvers.traits import ITERATIVE

FLAT = 1e-12
"""|Qd| of each row, over |Q||d|, up to which Qd is rounding."""


@register
class MPRGPOnQP(Solver):
    """The method of mprgp between bounds."""

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="mprgp-qp",
        node="qp",
        summary="modified proportioning with reduced gradient projections, bounds only",
        method="projection",
        citation="Dostál and Schöberl 2005, Comput. Optim. Appl. 30:23",
        traits=ITERATIVE,
        options=MPRGPOptions,
    )

    def obstacle(self, problem: QP) -> str | None:
        if problem.b.size or problem.d.size:
            rows = f"{problem.b.size} of A, {problem.d.size} of C"
            return f"takes bounds only, there are rows ({rows}): use an active-set or interior-point method"
        return definite_obstacle(problem.Q, True, "a solver of nonconvex programs")

    def setup(self, problem: QP, budget: Budget, options: MPRGPOptions) -> ScaledBox:
        size = max(1.0, max_abs(problem.p))
        return scaled_box(problem, problem.Q, problem.p, problem.lb, problem.ub, size)

    def solve(
        self,
        prepared: ScaledBox,
        budget: Budget,
        options: MPRGPOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem: QP = prepared.problem

        def point(z: Vector) -> QPPoint:
            return with_multipliers(problem, z)

        measure = ErrorMeasure(problem, tolerance=budget.tolerance)

        def error(z: Vector) -> float:
            answer = point(z)
            return measure.error((answer.z, answer.lam, answer.mu, answer.nu))

        first = np.zeros(problem.p.size) if start is None else start.z
        ended = minimize(prepared, options, budget, first, error, point, record)
        if ended.error <= budget.tolerance:
            return SolverOutput(claim=Claim.SOLVED, point=point(ended.z), counters=ended.counters)
        claim, message = ended.claim, ended.message
        if ended.ray is not None:
            ray = descent_without_end(problem, ended.ray, budget)
            if ray is not None:
                fall = float(problem.p @ ray)
                return SolverOutput(
                    claim=Claim.UNBOUNDED,
                    counters=ended.counters,
                    message=f"{message}: Qd = 0, pᵀd = {fall:.2e} and z + td within the bounds for every t > 0",
                )
            message += ", and nothing proves that the objective is unbounded"
        elif claim is Claim.FAILED and ended.error <= CLOSE * budget.tolerance:
            claim = Claim.INACCURATE
        message = f"{message}, error {ended.error:.1e}"
        return SolverOutput(claim=claim, point=point(ended.z), counters=ended.counters, message=message)


def with_multipliers(problem: QP, z: Vector) -> QPPoint:
    """Return z between its bounds, with ν the gradient where a bound holds it against that."""
    z = project_box(z, problem.lb, problem.ub)
    with np.errstate(all="ignore"):
        gradient = problem.Q @ z + problem.p
    held = ((z == problem.lb) & (gradient > 0)) | ((z == problem.ub) & (gradient < 0))
    return QPPoint(z=z, lam=np.zeros(0), mu=np.zeros(0), nu=np.where(held, gradient, 0.0))


def descent_without_end(problem: QP, ray: Vector, budget: Budget) -> Vector | None:
    """Return a checked d, ‖d‖∞ = 1, with Qd = 0, pᵀd < 0 and no bound in its way: the objective falls for ever. None
    where neither the ray is one nor a linear program finds one."""
    low = np.where(np.isfinite(problem.lb), 0.0, -1.0)
    high = np.where(np.isfinite(problem.ub), 0.0, 1.0)
    d = np.clip(ray / (max_abs(ray) or 1.0), low, high)
    if _falls(problem, d):
        return d
    flat, cost = problem.Q / (max_abs(problem.Q) or 1.0), problem.p / (max_abs(problem.p) or 1.0)
    bounds = np.column_stack([low, high])
    x = linear_program.multipliers(cost, budget, A_eq=flat, b_eq=np.zeros(d.size), bounds=bounds)
    if x is None:
        return None
    d = np.clip(x, low, high)
    return d if _falls(problem, d) else None


def _falls(problem: QP, d: Vector) -> bool:
    rounding = FLAT * (abs(problem.Q) @ np.abs(d))
    return bool((np.abs(problem.Q @ d) <= rounding).all() and problem.p @ d < -1e-9 * max_abs(problem.p) * max_abs(d))
