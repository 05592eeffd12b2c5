"""Accelerated projected gradient descent on a convex cone program whose unknowns are in the cone themselves.

min ½xᵀQx + pᵀx over x ∈ K, by Nesterov's method: from the extrapolated point z

    x⁺ = P_K(z − t(Qz + p)),   z⁺ = x⁺ + β(x⁺ − x),   β = θ(1 − θ)/(θ² + θ⁺),   (θ⁺)² = (1 − θ⁺)θ²

with a step t that is halved until ½(x⁺ − z)ᵀQ(x⁺ − z) ≤ ½‖x⁺ − z‖²/t and grows a little in every iteration, and the
momentum dropped (θ = 1) where it points uphill, (Qz + p)ᵀ(x⁺ − x) > 0. Unknowns are first scaled, by one number a
factor, so that the diagonal of Q is about 1: K stays what it is but for the radii of disks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.coneqp import ConeQP, ConeQPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.foundation.product_cones import Cone, ProductCone
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, register
from cpbench.solvers.shared.progress import SHARE, Progress
from cpbench_solvers.cone.scaled_form import judged
from cpbench_solvers.lcp.claims import concluded
from cpbench_solvers.nonlinear.natural_map import congruent, equilibrate
from cpbench_solvers.traits import ITERATIVE

GROW = 1.05
HALVINGS = 60


@dataclass(frozen=True)
class APGDOptions:
    """Options of apgd. `max_iterations`. `stall_window` : iterations without gain after which it gives up."""

    max_iterations: int = 200_000
    stall_window: int = 20_000


@dataclass(frozen=True)
class ScaledProgram:
    """The program in its own units, x of the problem is `unit` times x here; error : the judged one of an answer."""

    problem: ConeQP
    Q: Matrix
    p: Vector
    K: ProductCone
    unit: Vector
    error: Callable[[ConeQPPoint], float]


@dataclass(frozen=True)
class _Iterate:
    """x with its gradient's linear part Qx, the extrapolated z with Qz, θ and the step t."""

    x: Vector
    Qx: Vector
    z: Vector
    Qz: Vector
    theta: float
    step: float


@register
class APGD(Solver):
    """Objective within O(1/k²) of the optimum for every Q ⪰ 0, linear convergence after restarts for Q ≻ 0."""

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="apgd",
        node="coneqp",
        summary="accelerated projected gradient descent with adaptive steps and restart, x in the cone itself",
        method="first order",
        citation="Mazhar, Heyn, Negrut and Tasora 2015, ACM Trans. Graph. 34:32; Nesterov 1983; "
        "O'Donoghue and Candès 2015",
        traits=ITERATIVE,
        options=APGDOptions,
    )

    def obstacle(self, problem: ConeQP) -> str | None:
        if not problem.plain:
            m, n = problem.A.shape
            return f"needs x itself in K (A = I, b = 0), A is {m}x{n}: use clarabel-coneqp"
        if not problem.convex:
            least = matrices.least_eigenvalue(problem.Q)
            return f"not convex: Q has, at unit diagonal, the eigenvalue {least:.1e} or less"
        return None

    def setup(self, problem: ConeQP, budget: Budget, options: APGDOptions) -> ScaledProgram:
        K = problem.K
        d = equilibrate(problem.Q, K.blocks)
        p = d * problem.p
        size = matrices.max_abs(np.where(K.extended, p, 0.0)) or 1.0
        unit = size * d
        error = judged(problem, budget.tolerance)
        return ScaledProgram(problem, congruent(problem.Q, d), p / size, K.in_units(1.0 / unit), unit, error)

    def warmup(self) -> None:
        self.run(ConeQP.over(np.eye(3), -np.ones(3), ProductCone.of((Cone.SECOND_ORDER, 1, 3, 0.5))))

    def solve(
        self,
        prepared: ScaledProgram,
        budget: Budget,
        options: APGDOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        x = np.zeros_like(prepared.unit) if start is None else prepared.K.project(start.x / prepared.unit)
        Qx = prepared.Q @ x
        counters = {"iterations": 0, "matrix_vector_products": 1, "projections": 0}
        at = _Iterate(x, Qx, x, Qx, 1.0, 1.0)
        best, error = _measured(prepared, at)
        if record is not None:
            record(0, error, lambda: best)
        limit, progress = budget.iterations or options.max_iterations, Progress(options.stall_window, budget.seconds)
        claim, message = Claim.MAX_ITER, f"{limit} iterations"
        check = 1
        while error > budget.tolerance and counters["iterations"] < limit:
            at = _advance(prepared, at, counters)
            done = counters["iterations"]
            if done < check and done < limit:
                continue
            check = done + 1 + done // SHARE
            point, reached = _measured(prepared, at)
            if record is not None:
                record(done, reached, lambda point=point: point)
            if reached < error:
                best, error = point, reached
            why = progress.trouble(done, reached)
            if why is not None:
                claim, message = Claim.FAILED, why
                break
        return concluded(best, error, budget, counters, claim, f"{message}, error {error:.1e}")


def _advance(program: ScaledProgram, at: _Iterate, counters: dict[str, int]) -> _Iterate:
    """Make one iteration; Qz is carried along as the combination that z is, so that each costs one product."""
    gradient = at.Qz + program.p
    step = GROW * at.step
    x, Qx = at.x, at.Qx
    for _ in range(HALVINGS):
        x = program.K.project(at.z - step * gradient)
        Qx = program.Q @ x
        counters["projections"] += 1
        counters["matrix_vector_products"] += 1
        change = x - at.z
        if change @ (Qx - at.Qz) <= (change @ change) / step:
            break
        step *= 0.5
    counters["iterations"] += 1
    moved = x - at.x
    if gradient @ moved > 0.0:
        return _Iterate(x, Qx, x, Qx, 1.0, step)
    theta = 0.5 * (-(at.theta**2) + at.theta * math.sqrt(at.theta**2 + 4.0))
    beta = at.theta * (1.0 - at.theta) / (at.theta**2 + theta)
    return _Iterate(x, Qx, x + beta * moved, Qx + beta * (Qx - at.Qx), theta, step)


def _measured(program: ScaledProgram, at: _Iterate) -> tuple[ConeQPPoint, float]:
    """Return x with y = Qx + p, which leaves the cone part of the error alone, and the judged error."""
    x = program.unit * at.x
    point = ConeQPPoint(x=x, y=program.problem.Q @ x + program.problem.p)
    return point, program.error(point)
