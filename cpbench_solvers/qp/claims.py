"""What the QP solvers share: the judged error, certificates to rounding that there is no solution, and the last word
on a claim."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property, partial
from typing import Any, TypeAlias

import numpy as np

from cpbench.formulations.programs import QP, QPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector, max_abs
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput
from cpbench_solvers.kernels import linear_error, linear_rows, qp_dense, qp_sparse
from cpbench_solvers.lcp.claims import concluded
from cpbench_solvers.qp.kkt_system import entries

DENSE_BYTES = 1e9
"""The most memory that the matrices of a dense solver may take."""
ROUNDING = 1e-10
"""A component of a proof that should be 0 may be this times the sum of what cancels in it."""
DECISIVE = 1e-7
"""What decides a proof must be at least this times the sum of the sizes of its terms."""
RESTORED = 1_000_000
"""Entries of the largest matrix of a least-squares problem that completes a proof."""


Parts: TypeAlias = tuple[Vector, Vector, Vector, Vector]
"""z, λ, μ, ν of an answer."""


class ErrorMeasure:
    """The judged error of answers to one problem, for whoever records as well.

    Of answers within `tolerance` it is the larger one of norms and of the verdict's error (`linear_error`).

    best : the answer with the least error of those that were seen, but not merely in passing: those are seen only where
    somebody records. least : that error. norms : the error of the last answer by norms.
    """

    def __init__(self, problem: QP, record: Record | None = None, tolerance: float = -1.0) -> None:
        self._problem, self._tolerance = problem, tolerance
        self._record, self._recorded = record, -1
        self._last: Parts | None = None
        self.best: Parts | None = None
        self.least = self.norms = math.inf
        P, blocks = problem, (problem.Q, problem.A, problem.C)
        if any(matrices.is_sparse(M) for M in blocks):
            self._judged, (Q, A, C), work = qp_sparse.judged_error, map(entries, blocks), ()
        else:
            self._judged, (Q, A, C), work = qp_dense.judged_error, blocks, (np.empty(2 * P.p.size),)
        self._data, self._work = (Q, P.p, A, P.b, C, P.d, P.lb, P.ub), work

    def error(self, answer: Parts) -> float:
        """Return `QP.residuals(...).error`, or the verdict's error where that is larger; infinite for an answer that
        is not finite."""
        self.norms = error = self._judged(*self._data, *answer, *self._work)
        return max(error, self.verdict(answer)) if error <= self._tolerance else error

    def verdict(self, answer: Parts) -> float:
        """Return the verdict's error; infinite for an answer that is not finite."""
        z, lam, mu, nu = answer
        return linear_error.largest_error(self._rows, np.concatenate([z, lam, mu]), nu)

    @cached_property
    def _rows(self) -> Any:
        """The conditions of the problem, as `linear_rows` has them."""
        P = self._problem
        G = qp_sparse.stacked(entries(P.A), entries(P.C))
        sides = np.concatenate([P.b, P.d])
        return linear_rows.linear(entries(P.Q), G, P.p, sides, P.b.size, P.lb, P.ub, True)

    def see(self, iteration: int, answer: Parts, *, passing: bool = False) -> float:
        """Return the error, recorded where nothing was recorded of that iteration."""
        error = self.error(answer)
        if self._record is not None and iteration > self._recorded:
            self._record(iteration, error, partial(QPPoint, *answer))
            self._recorded, self._last = iteration, answer
        if not passing and (self.best is None or error < self.least):
            self.best, self.least = answer, error
        return error

    def conclude(
        self, budget: Budget, counters: Mapping[str, int], otherwise: Claim | None = None, message: str = ""
    ) -> SolverOutput:
        """Return the best answer with a claim: solved exactly when its error is at most the tolerance.

        Else the claim is `otherwise`. In the place of None and of failed: inaccurate up to CLOSE times the tolerance,
        failed beyond it. `message` : default: the error and the tolerance.
        """
        assert self.best is not None
        if self._record is not None and self._last is not self.best:  # a history ends in the answer
            self._record(self._recorded + 1, self.least, partial(QPPoint, *self.best))
        message = message or f"ended at error {self.least:.1e}, asked for {budget.tolerance:.0e}"
        otherwise = None if otherwise is Claim.FAILED else otherwise
        return concluded(QPPoint(*self.best), self.least, budget, dict(counters), otherwise, message)


def dense_obstacle(problem: QP) -> str | None:
    """Return why dense matrices are out of the question, else None."""
    n, rows = problem.p.size, problem.b.size + problem.d.size
    size = 8.0 * n * (4 * n + 2 * rows)
    if size <= DENSE_BYTES:
        return None
    return f"keeps dense matrices: n = {n} with {rows} rows takes {size / 1e9:.1f} GB: use interior-point-qp"


def convex_obstacle(problem: QP) -> str | None:
    """Return why a problem is not convex, or none at all, else None."""
    if problem.p.size == 0:
        return "has no unknown (n = 0): there is nothing to minimise"
    if problem.convex:
        return None
    return f"not convex: Q has, at unit diagonal, the eigenvalue {matrices.least_eigenvalue(problem.Q):.1e}"


def definite_obstacle(problem: QP) -> str | None:
    """Return why Q, brought to a diagonal of ones, is not positive definite beyond rounding, else None."""
    if matrices.is_definite(problem.Q):
        return None
    return "needs Q positive definite, Q is singular: use proximal-active-set or interior-point-qp"


def infeasibility(problem: QP, lam: Vector, mu: Vector) -> float | None:
    """Return bᵀλ + dᵀμ + lbᵀν⁺ − ubᵀν⁻ > 0 for λ ≥ 0 and ν = −Aᵀλ − Cᵀμ with ν⁺, ν⁻ at finite bounds only; None
    where it is not. No z satisfies the constraints then, for λᵀAz + μᵀCz + νᵀz = 0 ≥ that sum (Farkas)."""
    size = max(max_abs(lam), max_abs(mu))
    if not 0.0 < size < np.inf:
        return None
    lam, mu = np.maximum(lam, 0.0) / size, mu / size
    nu = -(problem.A.T @ lam + problem.C.T @ mu)
    noise = ROUNDING * (abs(problem.A).T @ lam + abs(problem.C).T @ abs(mu))
    nu = np.where(abs(nu) <= noise, 0.0, nu)
    if (nu[np.isneginf(problem.lb)] > 0.0).any() or (nu[np.isposinf(problem.ub)] < 0.0).any():
        return None
    bound = np.where(nu > 0.0, problem.lb, np.where(nu < 0.0, problem.ub, 0.0))
    terms = np.concatenate([problem.b * lam, problem.d * mu, bound * nu])
    value = float(terms.sum())
    return value if value > DECISIVE * float(abs(terms).sum()) else None


def unboundedness(problem: QP, ray: Vector) -> float | None:
    """Return pᵀx < 0 for a ray x with Qx = 0, Ax ≥ 0, Cx = 0, x ≥ 0 (≤ 0) at finite lower (upper) bounds; None where
    it is not. From a point that satisfies the constraints the objective falls along x for ever."""
    size = max_abs(ray)
    if not 0.0 < size < np.inf:
        return None
    x = ray / size
    rest = DECISIVE * max_abs(x)
    x = np.where(np.isfinite(problem.lb) & (abs(x) <= rest), np.maximum(x, 0.0), x)
    x = np.where(np.isfinite(problem.ub) & (abs(x) <= rest), np.minimum(x, 0.0), x)
    slope = problem.p * x
    if not slope.sum() < -DECISIVE * abs(slope).sum():
        return None

    def noise(M: Matrix) -> Vector:
        return DECISIVE * (abs(M) @ abs(x))

    flat = (abs(problem.Q @ x) <= noise(problem.Q)).all() and (abs(problem.C @ x) <= noise(problem.C)).all()
    inside = (problem.A @ x >= -noise(problem.A)).all()
    inside = inside and (x[np.isfinite(problem.lb)] >= 0.0).all() and (x[np.isfinite(problem.ub)] <= 0.0).all()
    return float(slope.sum()) if flat and inside else None


def infeasible(problem: QP, lam: Vector, mu: Vector, counters: Mapping[str, int]) -> SolverOutput | None:
    """Return the claim with its certificate, where the multipliers are one to rounding: as they are, or their large
    ones with Aᵀλ + Cᵀμ = 0 restored."""
    for restore in (False, True):
        if restore:
            lam, mu = _restored(problem, lam, mu)
        value = infeasibility(problem, lam, mu)
        certificate = np.concatenate([np.maximum(lam, 0.0), mu])
        if value is not None and problem.certifies_infeasibility(certificate):
            message = f"λ ≥ 0, Aᵀλ + Cᵀμ + ν = 0, bᵀλ + dᵀμ + lbᵀν⁺ − ubᵀν⁻ = {value:.1e} > 0, to rounding"
            counted = dict(counters)
            return SolverOutput(claim=Claim.INFEASIBLE, counters=counted, certificate=certificate, message=message)
    return None


def _restored(problem: QP, lam: Vector, mu: Vector) -> tuple[Vector, Vector]:
    """Return small multipliers 0, the others corrected by least squares so that ν is 0 where there is no bound."""
    y, m = np.concatenate([np.maximum(lam, 0.0), mu]), lam.size
    kept = np.flatnonzero(abs(y) > DECISIVE * max_abs(y))
    free = np.flatnonzero(np.isinf(problem.lb) & np.isinf(problem.ub))
    y[abs(y) <= DECISIVE * max_abs(y)] = 0.0
    if 0 < kept.size * free.size <= RESTORED:
        rows = np.vstack([matrices.dense(problem.A), matrices.dense(problem.C)])[np.ix_(kept, free)].T
        y[kept] -= np.linalg.lstsq(rows, rows @ y[kept])[0]
    return y[:m], y[m:]


def unbounded(problem: QP, ray: Vector, counters: Mapping[str, int]) -> SolverOutput | None:
    """Return the claim, where the ray is one to rounding: as it is, or with its small components 0."""
    slope = unboundedness(problem, ray)
    if slope is None:
        slope = unboundedness(problem, np.where(abs(ray) > DECISIVE * max_abs(ray), ray, 0.0))
    if slope is None:
        return None
    message = (
        f"a ray x of the constraints with Qx = 0 and pᵀx/|x| = {slope:.1e} < 0, to rounding: unbounded if feasible"
    )
    return SolverOutput(claim=Claim.UNBOUNDED, counters=dict(counters), message=message)
