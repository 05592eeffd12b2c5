"""Semismooth Newton on the natural map of a cone LCP, for nonsymmetric M too; projection and contraction beside it.

What is looked for are the zeros of F(x) = x − P_K(x − w), w = Mx + q.

Newton      (I − J + J(M + εI)) d = −F with J ∈ ∂P_K(x − w), ε → 0 with ‖F‖. It is nonsingular for monotone M and
            ε > 0 (J is symmetric, 0 ⪯ J ⪯ I), and the steps converge superlinearly where F grows with the distance
            to the solutions. A step of length t is taken when it cuts ‖F‖ by the factor 1 − t·DESCENT.
Otherwise   x ← x − γ(I + M)⁻¹F(x), 0 < γ < 2, several times with one factorization (He 1997). For monotone M

                (x − x*)ᵀ(I + M)ᵀF ≥ ‖F‖², hence ‖x⁺ − x*‖_G² ≤ ‖x − x*‖_G² − γ(2 − γ)‖F‖², G = (I + M)ᵀ(I + M),

            and F → 0 whatever K is. Newton is tried again after a while, each time a longer one, and must beat the
            least ‖F‖ at which it was accepted: either it takes over or the other converges alone.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack

from cpbench.formulations.conic import SOCLCP, SOCLCPPoint
from cpbench.foundation.cones import ProductCone
from cpbench.foundation.factorization import sparse_lu
from cpbench.foundation.matrices import Matrix, Vector, dense, identity, max_abs, norm
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, register, solved
from cpbench.solvers.shared.jacobians import projection_jacobian
from cpbench.solvers.shared.progress import Progress
from cpbench_solvers.cone.scaled_form import judged
from cpbench_solvers.lcp.claims import solve_linear
from cpbench_solvers.qp.scaling import congruent, equilibrate
from cpbench_solvers.traits import ITERATIVE

DESCENT = 1e-2
LENGTHS = (1.0, 0.5, 0.25, 0.125)
EPSILON = ((1e-3, 1.0), (1e-1, 1.0), (0.03, 0.5), (0.3, 0.5))
"""ε = c‖F‖^k for (c, k), at most 1, one after the other until one descends; √‖F‖ is for degenerate solutions on curved
boundaries, where steps along the null space of the derivative are too long otherwise.
"""
GAMMA = 1.6
FIRST_PHASE = 10
"""Steps of projection and contraction before Newton is tried again the first time."""
STALL = 500
ROUNDING = 16 * float(np.finfo(float).eps)
"""‖F‖ over ‖x‖ + ‖q‖ below which no step means anything."""


@dataclass(frozen=True)
class NewtonOptions:
    """Options of newton-soclcp. `max_iterations` : steps of either kind."""

    max_iterations: int = 20_000


class ScaledSOCLCP(NamedTuple):
    """The data in units in which the largest entries of M, and of w and x in a solution, are about 1; `unit` times x is
    that of the problem. error_of : the judged error of an answer."""

    M: Matrix
    q: Vector
    K: ProductCone
    unit: Vector
    error_of: Callable[[SOCLCPPoint], float]

    def answer(self, x: Vector) -> SOCLCPPoint:
        """Return an x in these units as an answer to the problem."""
        return SOCLCPPoint(self.unit * x)

    def error(self, x: Vector) -> float:
        """Return the judged error of an x in these units."""
        return self.error_of(self.answer(x))


@register
class NewtonCone(Solver):
    """Newton steps on x − P_K(x − w) with exact Jacobians; projection and contraction where they do not descend.

    Converges from anywhere for monotone M, to a solution if there is one; other M are tried, and what comes out is
    claimed only as far as it was measured.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="newton-soclcp",
        node="soclcp",
        summary="semismooth Newton on the natural map of a cone, safeguarded by projection and contraction",
        method="semismooth Newton",
        citation="Qi and Sun 1993, Math. Program. 58:353; He 1997, Appl. Math. Optim. 35:69",
        traits=ITERATIVE,
        quick=True,
        options=NewtonOptions,
    )

    def setup(self, problem: SOCLCP, budget: Budget, options: NewtonOptions) -> ScaledSOCLCP:
        K = problem.K
        d = equilibrate(problem.M, K.blocks)
        # where K is {0}, F does not depend on q, and a large force there must not set a scale
        weighed = d * np.where(K.extended, problem.q, 0.0)
        size = max_abs(weighed) or 1.0
        return ScaledSOCLCP(congruent(problem.M, d), weighed / size, K, size * d, judged(problem, budget.tolerance))

    def solve(
        self,
        prepared: ScaledSOCLCP,
        budget: Budget,
        options: NewtonOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        x = np.zeros_like(prepared.unit) if start is None else start.vector
        limit = budget.iterations or options.max_iterations
        return _run(prepared, prepared.K.project(x / prepared.unit), budget, limit, record)


def _run(form: ScaledSOCLCP, start: Vector, budget: Budget, limit: int, record: Record | None) -> SolverOutput:
    """Take steps until the judged error is at most the tolerance, or nothing gains, or the limits are reached."""
    counters = {"iterations": 0, "factorizations": 0, "projections": 0}
    x, F = start, _natural(form, start, counters)
    best, error = x, form.error(x)
    if record is not None:
        record(0, error, partial(form.answer, x))
    accepted, phase = math.inf, FIRST_PHASE
    contract: Callable[[Vector], Vector | None] | None = None
    waiting = 0
    progress, deadline = Progress(STALL), time.monotonic() + budget.seconds

    def ended(claim: Claim, why: str) -> SolverOutput:
        message = f"{why}, error {error:.1e}"
        return SolverOutput(claim=claim, point=form.answer(best), counters=counters, message=message)

    while True:
        done = counters["iterations"]
        if error <= budget.tolerance:
            return solved(form.answer(best), counters)
        if norm(F) <= ROUNDING * (norm(x) + norm(form.q)):
            return ended(Claim.INACCURATE, "converged up to rounding")
        if done >= limit:
            return ended(Claim.MAX_ITER, f"{limit} iterations")
        if time.monotonic() > deadline:
            return ended(Claim.FAILED, f"out of time after {done} iterations")
        step = None
        if waiting == 0:
            step = _newton(form, x, F, min(accepted, norm(F)), counters)
            if step is None:
                waiting, phase = phase, 2 * phase
            else:
                accepted = norm(step[1])
        if step is None:
            if contract is None:
                contract = _contraction(form, counters)
            shift = contract(F)
            if shift is None:
                return ended(Claim.FAILED, f"I + M is singular, after {done} iterations")
            x = x - GAMMA * shift
            step = x, _natural(form, x, counters)
            waiting -= 1
        x, F = step
        counters["iterations"] += 1
        reached = form.error(x)
        if record is not None:
            record(counters["iterations"], reached, partial(form.answer, x))
        if reached < error:
            best, error = x, reached
        why = progress.trouble(counters["iterations"], reached)
        if why is not None:
            return ended(Claim.FAILED, why)


def _natural(form: ScaledSOCLCP, x: Vector, counters: dict[str, int]) -> Vector:
    counters["projections"] += 1
    return x - form.K.project(x - (form.M @ x + form.q))


def _newton(
    form: ScaledSOCLCP, x: Vector, F: Vector, goal: float, counters: dict[str, int]
) -> tuple[Vector, Vector] | None:
    """Return the next x and its F with ‖F‖ below `goal` by the asked factor; None when no step does it."""
    n, size = x.size, norm(F)
    J = projection_jacobian(form.K, x - (form.M @ x + form.q))
    eye = identity(n, form.M)
    rest = eye - J if sp.issparse(form.M) else np.eye(n) - J.toarray()
    JM = J @ form.M
    for share, power in EPSILON:
        counters["factorizations"] += 1
        shifted = min(share * size**power, 1.0) * J
        matrix = rest + JM + (shifted if sp.issparse(form.M) else shifted.toarray())
        d = solve_linear(matrix, -F)
        if d is None:
            continue
        for t in LENGTHS:
            trial = x + t * d
            value = _natural(form, trial, counters)
            if norm(value) <= (1.0 - DESCENT * t) * goal:
                return trial, value
    return None


def _contraction(form: ScaledSOCLCP, counters: dict[str, int]) -> Callable[[Vector], Vector | None]:
    """Return F -> (I + M)⁻¹F with one factorization."""
    counters["factorizations"] += 1
    whole = form.M + identity(form.q.size, form.M)
    if sp.issparse(whole):
        lu = sparse_lu(sp.csc_array(whole))
        return lambda F: None if lu is None else _finite(lu.solve(F))
    factors, pivots, info = lapack.dgetrf(dense(whole))
    return lambda F: None if info != 0 else _finite(lapack.dgetrs(factors, pivots, F)[0])


def _finite(x: Vector) -> Vector | None:
    return x if np.isfinite(x).all() else None
