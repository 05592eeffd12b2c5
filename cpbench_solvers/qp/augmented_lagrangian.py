"""Augmented Lagrangian and proximal method of multipliers for convex QPs, each subproblem by semismooth Newton.

With s = (x, Gx), multipliers y and the proximal centre x⁰, a subproblem is to minimise

    f(x) + ½ρ‖x − x⁰‖² + Σ dist²(s_i − θ_i y_i, [lower_i, upper_i]) / 2θ_i.

Its minimiser gives y⁺ = (P(s − θy) − (s − θy))/θ, P the projection on [lower, upper]. Its gradient is piecewise linear:
Newton's method ends after finitely many steps, with an exact line search from everywhere.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.programs import QP
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector, max_abs
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, register
from cpbench.solvers.shared.progress import Progress
from cpbench_solvers.qp.claims import ErrorMeasure, convex_obstacle, infeasible, unbounded
from cpbench_solvers.qp.kkt_system import KKT, entries
from cpbench_solvers.qp.scaling import ScaledQP, scaled
from cpbench_solvers.traits import ITERATIVE

STALL = 60
"""Least number of Newton steps without gain that ends a run."""
INACTIVE = 1e20
"""θ of rows inside their bounds: they take no part in a Newton step."""
REGULARIZATION = 1e-11
"""Of the linear systems, which refinement takes out again."""
LEAST_THETA = 1e-9
GAIN = 0.1
"""θ falls by its factor unless the constraints are met this much better than before."""
BISECTIONS = 60


@dataclass(frozen=True)
class AugmentedLagrangianOptions:
    """Options of augmented-lagrangian. `theta` : θ of inequalities at first, data scaled to size one. `fall` :
    factor by which it falls. `proximal` : ρ, relative to the size of Q. `max_iterations` : Newton steps."""

    theta: float = 0.1
    fall: float = 0.1
    proximal: float = 1e-8
    max_iterations: int = 2000


class Subproblem:
    """The function above at x⁰, y, and its derivatives. slope : of a step."""

    def __init__(self, form: ScaledQP, Gt: Any, x0: Vector, y: Vector, theta: Vector, rho: float) -> None:
        self.form, self.Gt, self.x0, self.theta, self.rho = form, Gt, x0, theta, rho
        self.shift = theta * y

    def multipliers(self, s: Vector) -> Vector:
        q = s - self.shift
        return (np.clip(q, self.form.lower, self.form.upper) - q) / self.theta

    def gradient(self, x: Vector, Hx: Vector, y: Vector) -> Vector:
        n = x.size
        return Hx + self.form.g + self.rho * (x - self.x0) - y[:n] - self.Gt @ y[n:]

    def length(self, x: Vector, Hx: Vector, s: Vector, dx: Vector, Hdx: Vector, ds: Vector) -> float:
        """Return where the derivative along dx, which rises, is 0."""
        flat = float(dx @ (Hx + self.form.g + self.rho * (x - self.x0)))
        curvature = float(dx @ Hdx) + self.rho * float(dx @ dx)

        def slope(alpha: float) -> float:
            return flat + alpha * curvature - float(ds @ self.multipliers(s + alpha * ds))

        low, high, at_low, at_high = 0.0, 1.0, slope(0.0), slope(1.0)
        if not at_low < 0.0:
            return 0.0
        while at_high < -1e-3 * -at_low and high < INACTIVE:
            low, high, at_low = high, 10.0 * high, at_high
            at_high = slope(high)
        for _ in range(BISECTIONS):
            if not at_high > 1e-10 * -at_low or high - low <= 1e-14 * high:
                break
            middle = low + (high - low) * min(max(at_low / (at_low - at_high), 0.05), 0.95)
            value = slope(middle)
            low, high, at_low, at_high = (middle, high, value, at_high) if value < 0 else (low, middle, at_low, value)
        return high


@register
class AugmentedLagrangian(Solver):
    """Multiplier steps with a falling θ; ρ only keeps the Newton systems regular, unless it is larger (1e-4: the
    proximal method of multipliers).

    Tolerance: subproblems are solved as far as the constraints are met; the judged error of x, y decides.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="augmented-lagrangian",
        node="qp",
        summary="augmented Lagrangian, semismooth Newton with exact line search, dense and sparse",
        method="augmented Lagrangian",
        citation="Hestenes 1969; Powell 1969; Hermans, Themelis and Patrinos 2019, 58th IEEE CDC",
        traits=ITERATIVE,
        options=AugmentedLagrangianOptions,
    )

    def obstacle(self, problem: QP) -> str | None:
        return convex_obstacle(problem)

    def solve(
        self,
        prepared: QP,
        budget: Budget,
        options: AugmentedLagrangianOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        form, measure = scaled(prepared, keep_sparse=True), ErrorMeasure(prepared, record, budget.tolerance)
        n, equal = form.g.size, form.lower == form.upper
        x, y = (np.zeros(n), np.zeros(equal.size)) if start is None else form.start(start)
        counters = {"iterations": 0, "multiplier_steps": 0, "factorizations": 0}
        kkt, Gt = KKT(entries(form.H), entries(form.G), REGULARIZATION), matrices.transpose(form.G)
        deadline, progress = time.monotonic() + budget.seconds, Progress(STALL)
        limit = budget.iterations or options.max_iterations
        rho = options.proximal * (max_abs(form.H) or 1.0)
        theta = np.where(equal, options.fall, 1.0) * options.theta
        met, inner = np.inf, 1.0
        x0, y0 = x, y
        Hx, s = form.H @ x, np.concatenate([x, form.G @ x])
        while True:
            done = counters["iterations"]
            error = measure.see(done, form.parts(x, y))
            if error <= budget.tolerance:
                return measure.conclude(budget, counters)
            if done >= limit or time.monotonic() + kkt.seconds > deadline:
                message = f"error {measure.least:.1e} after {done} iterations of about {kkt.seconds:.1g} s"
                return measure.conclude(budget, counters, Claim.MAX_ITER, message)
            trouble = progress.trouble(done, error)
            if trouble is not None:
                return measure.conclude(budget, counters, Claim.FAILED, trouble)
            sub = Subproblem(form, Gt, x0, y0, theta, rho)
            y = sub.multipliers(s)
            gradient = sub.gradient(x, Hx, y)
            if max_abs(gradient) <= inner:
                proved = self._proved(prepared, form, x - x0, y - y0, counters)
                if proved is not None:
                    return proved
                violation = max_abs(s - np.clip(s, form.lower, form.upper))
                if violation > GAIN * met:
                    theta = np.maximum(options.fall * theta, LEAST_THETA)
                met, inner = min(met, violation), max(0.1 * min(inner, violation or inner), 1e-14)
                x0, y0 = x, y
                counters["multiplier_steps"] += 1
                sub = Subproblem(form, Gt, x0, y0, theta, rho)
                y = sub.multipliers(s)
                gradient = sub.gradient(x, Hx, y)
            active = y != 0.0
            weight = np.where(active, theta, INACTIVE)
            if not kkt.factor(np.where(active[:n], 1.0 / theta[:n], 0.0) + rho, weight[n:]):
                message = f"the Newton system broke down at error {measure.least:.1e} after {done} iterations"
                return measure.conclude(budget, counters, Claim.FAILED, message)
            dx, _ = kkt.solve(-gradient, np.zeros(equal.size - n))
            Hdx, ds = form.H @ dx, np.concatenate([dx, form.G @ dx])
            alpha = sub.length(x, Hx, s, dx, Hdx, ds)
            x, Hx, s = x + alpha * dx, Hx + alpha * Hdx, s + alpha * ds
            y = sub.multipliers(s)
            counters["iterations"] += 1
            counters["factorizations"] += 1

    @staticmethod
    def _proved(problem: QP, form: ScaledQP, dx: Vector, dy: Vector, counters: dict[str, int]) -> SolverOutput | None:
        """Return what a step of centre and multipliers proves when they go on and on (Banjac et al. 2019)."""
        n, m = form.g.size, problem.b.size
        rows = dy[n:] * form.E
        certificate = infeasible(problem, rows[:m], rows[m:], counters) if max_abs(dy) > 1.0 else None
        return certificate or (unbounded(problem, form.D * dx, counters) if max_abs(dx) > 1.0 else None)
