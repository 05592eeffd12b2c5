"""Proximal-point steps for convex dense QPs whose Q is singular, each by the dual active set."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.programs import QP, QPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import max_abs
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register, solved
from cpbench.solvers.shared.progress import Progress
from cpbench_solvers.kernels import qp_small
from cpbench_solvers.qp.claims import ErrorMeasure, convex_obstacle, dense_obstacle, infeasible, unbounded
from cpbench_solvers.qp.dual_active_set import CHUNK, ActiveSet
from cpbench_solvers.qp.scaling import scaled

STALL = 30
"""Least number of iterations without gain that ends a run."""
LEAST = 0.1
"""The size of Q, its data scaled, counts as this at least when ε is chosen: Q may be 0."""


PASSES, OPERATIONS = 10, 10**9
"""Of the one compiled call: passes, times the unknowns and rows, and operations, a quarter of a second: it does not
look at the clock. Who needs more may need the checks of the other way."""


@dataclass(frozen=True)
class ProximalActiveSetOptions:
    """Options of proximal-active-set. `proximal` : ε relative to the size of Q. `feasibility_tolerance` : as in
    dual-active-set. `max_iterations` : proximal steps and passes together, 0 stands for 50(n + rows) + 1000. `crowd` :
    where more sides than this times the unknowns exclude the minimum without them, most unknowns will be held, by many
    passes: the first call leaves the problem to others."""

    proximal: float = 1e-5
    feasibility_tolerance: float = 1e-11
    max_iterations: int = 0
    crowd: float = math.inf


def fits_one_call(n: int, rows: int) -> bool:
    """Return whether one compiled call factorizes and solves with all rows between two looks at the clock."""
    return n * n * (n + rows) <= CHUNK


def in_one_call(
    problem: QP, tolerance: float, options: ProximalActiveSetOptions, limit: int | None = None
) -> SolverOutput | None:
    """Return the answer of one compiled call, that Q is not convex, or the best after `limit` passes; else None."""
    P, (n, m, k) = problem, (problem.p.size, problem.b.size, problem.d.size)
    x, error, counts = np.zeros(2 * n + m + k), np.empty(1), np.zeros(4, dtype=np.int64)
    z, lam, mu, nu = x[:n], x[n : n + m], x[n + m : n + m + k], x[n + m + k :]
    Q, A, C = matrices.dense(P.Q), matrices.dense(P.A), matrices.dense(P.C)
    solve, solved_by, not_convex, crowded = _one_call()
    most = PASSES * (n + m + k + 10)
    if limit is not None:
        most = min(most, limit)
    how = matrices.PSD_TOLERANCE, options.proximal, options.feasibility_tolerance, options.crowd, most, OPERATIONS
    outcome = solve(Q, P.p, A, P.b, C, P.d, P.lb, P.ub, tolerance, *how, z, lam, mu, nu, error, counts)
    passes, steps = counts[:2].tolist()
    counters = {"iterations": passes + steps, "proximal_steps": steps}
    if outcome == solved_by:
        return solved(QPPoint(z, lam, mu, nu), counters)
    if outcome == not_convex and not P.convex:
        return SolverOutput(claim=Claim.FAILED, counters=counters, message="Q is not convex")
    if outcome == crowded:
        message = f"more than {options.crowd * n:.0f} sides exclude the minimum without them"
        return SolverOutput(claim=Claim.FAILED, counters=counters, message=message)
    if limit is not None and passes >= limit:
        message = f"error {error[0]:.1e} after {passes} passes"
        return SolverOutput(claim=Claim.MAX_ITER, point=QPPoint(z, lam, mu, nu), counters=counters, message=message)
    return None


def record_ends(problem: QP, answer: QPPoint, iterations: int, record: Record) -> None:
    """Record zero and the answer: a compiled call has nothing between, and recording must not change the method."""
    measure = ErrorMeasure(problem)
    for iteration, point in ((0, problem.zero_point()), (max(1, iterations), answer)):
        parts = point.z, point.lam, point.mu, point.nu
        record(iteration, measure.error(parts), partial(QPPoint, *parts))


@cache
def _one_call() -> tuple[Any, int, int, int]:
    """Return the compiled call and its outcomes: solved, Q not convex, and too many sides."""
    kernel = qp_small
    return kernel.solve, kernel.SOLVED, kernel.NOT_CONVEX, kernel.CROWDED


@register
class ProximalActiveSet(Solver):
    """x⁺ = argmin ½xᵀQx + pᵀx + ½ε‖x − x⁰‖² over the constraints, from the working set of the step before.

    Q + εI is factorized once. The steps end after finitely many where the constraints bind (a linear program), else
    they converge with the factor ε/(ε + σ), σ the least eigenvalue of Q that is not 0. A step that repeats itself is a
    ray along which the objective may be unbounded: that is checked.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="proximal-active-set",
        node="qp",
        summary="proximal-point steps over the dual active set, dense, Q semidefinite",
        method="dual active set",
        citation="Rockafellar 1976, SIAM J. Control Optim. 14:877; Arnström, Bemporad and Axehill 2022, IEEE TAC 67",
        traits=frozenset({Trait.WARM_START, Trait.HISTORY, Trait.DETERMINISTIC}),
        options=ProximalActiveSetOptions,
    )

    def obstacle(self, problem: QP) -> str | None:
        return dense_obstacle(problem) or convex_obstacle(problem)

    def solve(
        self,
        prepared: QP,
        budget: Budget,
        options: ProximalActiveSetOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        if start is None and fits_one_call(prepared.p.size, prepared.b.size + prepared.d.size):
            output = in_one_call(prepared, budget.tolerance, options, budget.iterations)
            if output is not None:
                if record is not None and output.point is not None:
                    record_ends(prepared, output.point, output.counters["iterations"], record)
                return output
        measure, form = ErrorMeasure(prepared, record, budget.tolerance), scaled(prepared)
        n, rows = form.g.size, form.E.size
        epsilon = options.proximal * max(max_abs(form.H), LEAST)
        H, G = matrices.dense(form.H), matrices.dense(form.G)
        H[np.diag_indices(n)] += epsilon
        x, y = (np.zeros(n), np.zeros(n + rows)) if start is None else form.start(start)
        measure.see(0, form.parts(x, y))
        try:
            method = ActiveSet(H, G, form.lower, form.upper, options.feasibility_tolerance)
        except np.linalg.LinAlgError as cause:
            message = f"Q + εI: {cause}: Q is not semidefinite to {options.proximal:.0e}"
            return measure.conclude(budget, {"iterations": 0}, Claim.FAILED, message)
        limit = budget.iterations or options.max_iterations or 50 * (n + rows) + 1000
        deadline, progress, stops = time.monotonic() + budget.seconds, Progress(STALL), method.stops
        steps = 0

        def look(passing: bool = True) -> float:
            return measure.see(method.passes + steps, form.parts(method.x(), method.multipliers()), passing=passing)

        while True:
            steps += 1
            method.begin(form.g - epsilon * x, y)
            outcome = method.climb(limit - steps, deadline, None if record is None else look)
            counters = {"iterations": method.passes + steps, "proximal_steps": steps}
            if outcome == stops.INFEASIBLE:
                y = method.multipliers() * np.concatenate([1.0 / form.D, form.E])
                m = prepared.b.size
                proved = infeasible(prepared, y[n : n + m], y[n + m :], counters)
                message = "the dual objective seems unbounded, and nothing proves it"
                return proved or measure.conclude(budget, counters, Claim.FAILED, message)
            error, before = look(passing=False), x
            x, y = method.x(), method.multipliers()
            if error <= budget.tolerance:
                return measure.conclude(budget, counters)
            if outcome == stops.LIMIT or counters["iterations"] >= limit or time.monotonic() > deadline:
                message = f"error {measure.least:.1e} after {counters['iterations']} iterations"
                return measure.conclude(budget, counters, Claim.MAX_ITER, message)
            endless = unbounded(prepared, form.D * (x - before), counters)
            if endless is not None:
                return endless
            trouble = progress.trouble(counters["iterations"], error)
            if trouble is not None:
                return measure.conclude(budget, counters, Claim.FAILED, trouble)
