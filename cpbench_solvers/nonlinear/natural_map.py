"""Semismooth Newton on the natural map of an affine variational inequality, made global by projection and contraction.

Find x ∈ K with wᵀ(y − x) ≥ 0 for all y ∈ K, w = Mx + q: the zeros of F(x) = x − P_K(x − w).

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
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack

from cpbench.foundation.factorization import sparse_lu
from cpbench.foundation.matrices import Matrix, Sparse, Vector, dense, identity, norm
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, solved
from cpbench.solvers.shared.progress import Progress
from cpbench_solvers.lcp.claims import solve_linear

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
RUIZ_STEPS = 8
ROUNDING = 16 * float(np.finfo(float).eps)
"""‖F‖ over ‖x‖ + ‖q‖ below which no step means anything."""


@dataclass(frozen=True)
class NewtonOptions:
    """Options of newton-avi, newton-relay, newton-soclcp. `max_iterations` : steps of either kind."""

    max_iterations: int = 20_000


@dataclass(frozen=True)
class AffineVI:
    """The data in units in which the largest entries of M, and of w and x in a solution, are about 1.

    Attributes
    ----------
    M, q : (n, n), (n,). project, jacobian : of the set K. answer : an x in these units as an answer to the problem.
    error : its judged error.
    """

    M: Matrix
    q: Vector
    project: Callable[[Vector], Vector]
    jacobian: Callable[[Vector], Sparse]
    answer: Callable[[Vector], Any]
    error: Callable[[Vector], float]


@dataclass(frozen=True)
class ScaledVI:
    """An affine variational inequality in its own units: x of the problem is `unit` times that of `vi`."""

    vi: AffineVI
    unit: Vector


class NaturalMapNewton(Solver):
    """Base of the solvers whose `setup` returns a `ScaledVI`."""

    def solve(
        self,
        prepared: ScaledVI,
        budget: Budget,
        options: NewtonOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        vi = prepared.vi
        x = np.zeros_like(prepared.unit) if start is None else start.vector
        limit = budget.iterations or options.max_iterations
        return run(vi, vi.project(x / prepared.unit), budget, limit, record)


def equilibrate(M: Matrix, groups: Any) -> Vector:
    """Return d > 0, equal within each group, such that the largest entry of every group of rows of diag(d) M diag(d) is
    about 1 (symmetric Ruiz scaling); a group of zero rows and columns keeps 1. Shape (n,).
    """
    n = M.shape[0]
    d = np.ones(n)
    if n == 0:
        return d
    size: Any = abs(M)
    for _ in range(RUIZ_STEPS):
        rows = _tops(congruent(size, d))
        top = np.zeros(int(groups[-1]) + 1)
        np.maximum.at(top, groups, rows)
        d = d / np.sqrt(np.where(top > 0, top, 1.0))[groups]
    return d


def _tops(size: Any) -> Vector:
    """Return the largest number of every row and column with the same index."""
    tops = [size.max(axis=axis) for axis in (0, 1)]
    return np.maximum(*[top.toarray().ravel() if sp.issparse(size) else top for top in tops])


def congruent(M: Matrix, d: Vector) -> Matrix:
    """Return diag(d) M diag(d)."""
    return sp.csr_array(sp.diags_array(d) @ M @ sp.diags_array(d)) if sp.issparse(M) else M * d[:, None] * d


def run(vi: AffineVI, start: Vector, budget: Budget, limit: int, record: Record | None) -> SolverOutput:
    """Take steps until the judged error is at most the tolerance, or nothing gains, or the limits are reached."""
    counters = {"iterations": 0, "factorizations": 0, "projections": 0}
    x, F = start, _natural(vi, start, counters)
    best, error = x, vi.error(x)
    if record is not None:
        record(0, error, partial(vi.answer, x))
    accepted, phase = math.inf, FIRST_PHASE
    contract: Callable[[Vector], Vector | None] | None = None
    waiting = 0
    progress, deadline = Progress(STALL), time.monotonic() + budget.seconds

    def ended(claim: Claim, why: str) -> SolverOutput:
        message = f"{why}, error {error:.1e}"
        return SolverOutput(claim=claim, point=vi.answer(best), counters=counters, message=message)

    while True:
        done = counters["iterations"]
        if error <= budget.tolerance:
            return solved(vi.answer(best), counters)
        if norm(F) <= ROUNDING * (norm(x) + norm(vi.q)):
            return ended(Claim.INACCURATE, "converged up to rounding")
        if done >= limit:
            return ended(Claim.MAX_ITER, f"{limit} iterations")
        if time.monotonic() > deadline:
            return ended(Claim.FAILED, f"out of time after {done} iterations")
        step = None
        if waiting == 0:
            step = _newton(vi, x, F, min(accepted, norm(F)), counters)
            if step is None:
                waiting, phase = phase, 2 * phase
            else:
                accepted = norm(step[1])
        if step is None:
            if contract is None:
                contract = _contraction(vi, counters)
            shift = contract(F)
            if shift is None:
                return ended(Claim.FAILED, f"I + M is singular, after {done} iterations")
            x = x - GAMMA * shift
            step = x, _natural(vi, x, counters)
            waiting -= 1
        x, F = step
        counters["iterations"] += 1
        reached = vi.error(x)
        if record is not None:
            record(counters["iterations"], reached, partial(vi.answer, x))
        if reached < error:
            best, error = x, reached
        why = progress.trouble(counters["iterations"], reached)
        if why is not None:
            return ended(Claim.FAILED, why)


def _natural(vi: AffineVI, x: Vector, counters: dict[str, int]) -> Vector:
    counters["projections"] += 1
    return x - vi.project(x - (vi.M @ x + vi.q))


def _newton(vi: AffineVI, x: Vector, F: Vector, goal: float, counters: dict[str, int]) -> tuple[Vector, Vector] | None:
    """Return the next x and its F with ‖F‖ below `goal` by the asked factor; None when no step does it."""
    n, size = x.size, norm(F)
    J = vi.jacobian(x - (vi.M @ x + vi.q))
    eye = identity(n, vi.M)
    rest = eye - J if sp.issparse(vi.M) else np.eye(n) - J.toarray()
    JM = J @ vi.M
    for share, power in EPSILON:
        counters["factorizations"] += 1
        shifted = min(share * size**power, 1.0) * J
        matrix = rest + JM + (shifted if sp.issparse(vi.M) else shifted.toarray())
        d = solve_linear(matrix, -F)
        if d is None:
            continue
        for t in LENGTHS:
            trial = x + t * d
            value = _natural(vi, trial, counters)
            if norm(value) <= (1.0 - DESCENT * t) * goal:
                return trial, value
    return None


def _contraction(vi: AffineVI, counters: dict[str, int]) -> Callable[[Vector], Vector | None]:
    """Return F -> (I + M)⁻¹F with one factorization."""
    counters["factorizations"] += 1
    whole = vi.M + identity(vi.q.size, vi.M)
    if sp.issparse(whole):
        lu = sparse_lu(sp.csc_array(whole))
        return lambda F: None if lu is None else _finite(lu.solve(F))
    factors, pivots, info = lapack.dgetrf(dense(whole))
    return lambda F: None if info != 0 else _finite(lapack.dgetrs(factors, pivots, F)[0])


def _finite(x: Vector) -> Vector | None:
    return x if np.isfinite(x).all() else None
