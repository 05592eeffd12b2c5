"""Mehrotra's predictor-corrector method for monotone LCPs and MLCPs, from points that need not be feasible.

Each step solves, for two right-hand sides, with one factorization of K + diag(0, w/v),

    K_f Δx = −r_f,   K_c Δx − Δw = −r_c,   WΔv + VΔw = σμe − VWe − Δv_aff Δw_aff

where f are the equalities (of free unknowns), c the pairs, r_f and r_c what is missing to Kx + k = (0, w).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np

from cpbench.formulations.linear import LCP, MLCP, LCPPoint, MLCPPoint
from cpbench.formulations.ncp_functions import fischer_burmeister, minimum
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector, max_abs
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, register
from cpbench.solvers.shared.progress import Progress
from cpbench_solvers.lcp.claims import CLOSE, conclude, recorded
from cpbench_solvers.lcp.interior_point_system import ShiftedSystem
from cpbench_solvers.mlcp.claims import ScaledMLCP, dense_obstacle, mixed, scale, settled
from cpbench_solvers.mlcp.newton import linear_box
from cpbench_solvers.nonlinear.box_newton import DENSE_LIMIT, run
from cpbench_solvers.nonlinear.semismooth_newton import SemismoothMethod, SemismoothOptions
from cpbench_solvers.traits import ITERATIVE

STALL = 10
"""Steps without gain that end a run."""
SHORT = 0.1
"""A step this short is taken again towards the centre (σ = ½), without the second-order term."""
CENTRAL, CUTS = 1e-4, 10
"""No product v_i w_i may fall below this share of their mean; how often a step is cut for it."""
FINISHING = 20
"""Newton steps on min(v, w) from the last point, where rounding ends the progress of the interior ones."""
WARM_SHARE = 1e-3
"""How far inside a given point is moved at least, as a share of its largest numbers."""


@dataclass(frozen=True)
class LCPInteriorPointOptions:
    """Options of interior-point-lcp, interior-point-mlcp. `max_iterations` : steps, one factorization each.
    `step_share` : how much of the way to the boundary is gone."""

    max_iterations: int = 200
    step_share: float = 0.995


class _Iterate(NamedTuple):
    """x = (u, v) with v > 0, and w > 0."""

    x: Vector
    w: Vector


def _first(prepared: ScaledMLCP, system: ShiftedSystem) -> _Iterate | None:
    """Start from (K + diag(0, I)) x = −k, so w = −v there: their positive parts, moved inside."""
    n = prepared.free
    if not system.factor(np.ones(prepared.k.size - n)):
        return None
    x = system.solve(-prepared.k)
    v = np.array(x[n:])
    inside = 0.5 * max_abs(v) or 1.0
    x[n:] = np.maximum(v, 0.0) + inside
    return _Iterate(x, np.maximum(-v, 0.0) + inside)


def _near(prepared: ScaledMLCP, x: Vector) -> _Iterate:
    """Return a given point, moved inside by its own error."""
    n = prepared.free
    w = (prepared.K @ x + prepared.k)[n:]
    inside = max(max_abs(np.minimum(x[n:], w)), WARM_SHARE * max(max_abs(x[n:]), max_abs(w))) or 1.0
    moved = np.array(x)
    moved[n:] = np.maximum(x[n:], inside)
    return _Iterate(moved, np.maximum(w, inside))


def _step(prepared: ScaledMLCP, system: ShiftedSystem, at: _Iterate, share: float) -> _Iterate | None:
    """Return the next iterate; None where the matrix is singular."""
    n, v, w = prepared.free, at.x[prepared.free :], at.w
    if not system.factor(w / v):
        return None
    mu = float(v @ w) / v.size
    missing = prepared.K @ at.x + prepared.k
    missing[n:] -= w

    def direction(products: Vector) -> tuple[Vector, Vector]:
        """Return Δx and Δw for WΔv + VΔw = `products` − VWe."""
        right = -missing
        right[n:] += products / v - w
        dx = system.solve(right)
        return dx, products / v - w - w / v * dx[n:]

    affine, affine_w = direction(np.zeros(v.size))
    reach = min(1.0, _reach(v, affine[n:]), _reach(w, affine_w))
    after = float((v + reach * affine[n:]) @ (w + reach * affine_w)) / v.size
    sigma = max((max(after, 0.0) / mu) ** 3, 1e-8)
    dx, dw = direction(sigma * mu - affine[n:] * affine_w)
    length = min(_reach(v, dx[n:]), _reach(w, dw))
    if length < SHORT:
        other, other_w = direction(np.full(v.size, 0.5 * mu))
        longer = min(_reach(v, other[n:]), _reach(w, other_w))
        if longer > length:
            dx, dw, length = other, other_w, longer
    # the nearer to the solution, the nearer to the boundary: otherwise convergence would be linear
    length = min(1.0, max(share, 1.0 - mu) * length)
    for _ in range(CUTS):
        products = (v + length * dx[n:]) * (w + length * dw)
        if not products.min() < CENTRAL * products.mean():
            break
        length *= 0.8
    return _Iterate(at.x + length * dx, at.w + length * dw)


def _reach(v: Vector, dv: Vector) -> float:
    """Return the largest t with v + t dv ≥ 0."""
    least = float((dv / v).min(initial=0.0))
    return -1.0 / least if least < 0.0 else np.inf


@np.errstate(all="ignore")
def _solve(
    prepared: ScaledMLCP,
    budget: Budget,
    options: LCPInteriorPointOptions,
    start: Vector | None,
    answer: Callable[[Vector], Any],
    record: Record | None,
) -> SolverOutput:
    """Take steps until the judged error is at most the tolerance, or the limits are reached, or nothing gains."""
    n = prepared.free
    system = ShiftedSystem(prepared.K, n)
    limit = budget.iterations or options.max_iterations
    deadline, progress = budget.deadline(), Progress(STALL)
    counters = {"iterations": 0, "factorizations": 0}
    best = shown = first = np.zeros(prepared.k.size) if start is None else start
    least = np.inf
    at: _Iterate | None = None
    claim, message = Claim.MAX_ITER, f"{limit} iterations"
    while True:
        done, error = counters["iterations"], prepared.error(shown, budget.tolerance)
        if record is not None:
            record(done, error, partial(answer, shown))
        if error < least:
            best, least = shown, error
        if error <= budget.tolerance or done >= limit:
            break
        trouble = progress.trouble(done, error)
        if time.perf_counter() > deadline:
            trouble = f"out of time after {done} iterations"
        if trouble is None:
            if at is None:
                at = _first(prepared, system) if start is None else _near(prepared, start)
                counters["factorizations"] += start is None
            at = _step(prepared, system, at, options.step_share) if at is not None and n < shown.size else at
            counters["factorizations"] += 1
            if at is None or not np.isfinite(at.x).all():
                trouble = (
                    f"singular matrix after {done} iterations at error {least:.1e}: not monotone, or A is singular"
                )
        if trouble is not None or at is None:
            counters["iterations"] += 1
            # what has no interior is left far behind by interior points: Newton's method goes on from the start, too
            ends = (_finished(prepared, x, budget.left(deadline)) for x in (best, first))
            best, least = min((best, least), *ends, key=lambda final: final[1])
            if record is not None:
                record(counters["iterations"], least, partial(answer, best))
            claim, message = Claim.INACCURATE if least <= CLOSE * budget.tolerance else Claim.FAILED, str(trouble)
            break
        counters["iterations"] = done + 1
        shown = at.x
    if least <= budget.tolerance:
        final = best
        best, least = settled(prepared, best, least, budget.tolerance)
        if record is not None and best is not final:
            record(counters["iterations"] + 1, least, partial(answer, best))
        claim, message = Claim.SOLVED, ""
    return SolverOutput(claim=claim, point=answer(best), counters=counters, message=message)


def _finished(prepared: ScaledMLCP, x: Vector, budget: Budget) -> tuple[Vector, float]:
    """Return where Newton's method on min(v, w) leads from x, and its error."""
    method = SemismoothMethod(linear_box(prepared), minimum, fischer_burmeister, SemismoothOptions())
    finished = run(method, budget, FINISHING, 0, x, None).point
    better = prepared.start(finished)
    return better, prepared.error(better, budget.tolerance)


_spec = partial(
    SolverSpec,
    method="interior point",
    citation="Mehrotra 1992, doi:10.1137/0802028; Wright 1997, Primal-Dual Interior-Point Methods, chapter 8",
    traits=ITERATIVE,
    options=LCPInteriorPointOptions,
)


class _InteriorPoint(Solver):
    """Base of the two solvers: an LCP is solved as the MLCP that it is."""

    def setup(self, problem: LCP | MLCP, budget: Budget, options: LCPInteriorPointOptions) -> ScaledMLCP:
        whole = mixed(problem)
        return scale(whole, keep_sparse=whole.a.size + whole.b.size > DENSE_LIMIT)

    def obstacle(self, problem: LCP | MLCP) -> str | None:
        whole = mixed(problem)
        stored = (whole.A, whole.B, whole.C, whole.D)
        return None if any(matrices.is_sparse(M) for M in stored) else dense_obstacle(whole)

    def solve(
        self,
        prepared: ScaledMLCP,
        budget: Budget,
        options: LCPInteriorPointOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        if self.spec.node == "mlcp":
            first = None if start is None else prepared.start(start)
            return _solve(prepared, budget, options, first, prepared.point, record)
        first = None if start is None else prepared.start(MLCPPoint(np.zeros(0), start.z))
        output = _solve(prepared, budget, options, first, lambda x: LCPPoint(prepared.point(x).v), record)
        if output.claim is not Claim.SOLVED or output.point is None:
            return output
        problem = LCP(M=prepared.problem.B, q=prepared.problem.b)
        z, steps = output.point.z, output.counters["iterations"]
        concluded = conclude(problem, z, budget, output.counters, error=0.0)  # by its own measure, until now
        return recorded(concluded, z, problem, record, steps + 2)  # steps + 1 may be the solution on the active set


@register
class InteriorPointLCP(_InteriorPoint):
    """A method that converges for monotone problems (M + Mᵀ positive semidefinite) that have a strictly feasible point,
    in a number of steps that hardly depends on their size; elsewhere it may stall, and says so."""

    spec: ClassVar[SolverSpec] = _spec(
        name="interior-point-lcp", node="lcp", summary="Mehrotra's predictor-corrector interior point"
    )


@register
class InteriorPointMLCP(_InteriorPoint):
    """A method that converges where [[A, C], [D, B]] is monotone on Au + Cv = 0 and strictly feasible points exist."""

    spec: ClassVar[SolverSpec] = _spec(
        name="interior-point-mlcp",
        node="mlcp",
        summary="Mehrotra's predictor-corrector interior point, with free unknowns",
    )
