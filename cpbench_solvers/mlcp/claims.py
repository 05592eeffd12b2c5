"""Base of the MLCP solvers: the data brought to size one, a proof of infeasibility, and the last word on a claim."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.linear import LCP, MLCP, MLCPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector, dense, max_abs
from cpbench.solvers.base import Budget, Claim, SolverOutput
from cpbench_solvers import linear_program
from cpbench_solvers.avi.claims import verdict_error
from cpbench_solvers.kernels import mlcp_judged, mlcp_scaling, row_errors
from cpbench_solvers.lcp.claims import WORTH, concluded, principal, size_obstacle, solve_linear

PASSES = 3
"""Times that rows and columns are divided by the roots of their largest entries."""
SINGULAR, SINGULAR_VALUES = 1e-12, 1000
"""Singular values that count as zero, as a share of the largest; the largest matrix of which they are computed."""


@dataclass(frozen=True)
class ScaledMLCP:
    """Rows K x + k, the first `free` of them zero and of x free, the others 0 ≤ x ⟂ Kx + k ≥ 0; entries of size one.

    Rows and columns are multiplied by powers of 2, which costs no rounding: a pair (v, w) by the same one, so that
    what is monotone or symmetric stays so, equalities and free unknowns by any.

    Attributes
    ----------
    problem : the MLCP that was asked. K : (N, N). k : (N,). unit : (N,), `unit` times x is (u, v).
    row_unit : (N,), times Kx + k is (Au + Cv + a, w).
    """

    problem: MLCP
    K: Matrix
    k: Vector
    free: int
    unit: Vector
    row_unit: Vector

    def point(self, x: Vector) -> MLCPPoint:
        both = self.unit * x
        return MLCPPoint(both[: self.free], both[self.free :])

    def start(self, point: MLCPPoint | None) -> Vector:
        """Return x of a starting point with v ≥ 0; 0 without one."""
        if point is None:
            return np.zeros(self.k.size)
        return np.concatenate([point.u, np.maximum(point.v, 0.0)]) / self.unit

    def error(self, x: Vector, tolerance: float = -1.0) -> float:
        """Return the error of norms or, of answers within the tolerance, the verdict's if that is larger; infinite
        where x is not finite."""
        error = self._of_norms(x)
        return max(error, self.verdict(x)) if error <= tolerance else error

    def verdict(self, x: Vector) -> float:
        """Return the verdict's error (`avi.claims`)."""
        if not matrices.is_sparse(self.K):
            exact = row_errors.is_exact
            if exact(self.K, self.k, x, self.free):
                return 0.0
        return verdict_error(self.problem, self.unit * x)

    def _of_norms(self, x: Vector) -> float:
        if matrices.is_sparse(self.K):
            return self.problem.residuals(self.point(x)).error
        kernel, P = mlcp_judged, self.problem
        # compiled, since small problems spend more time on measuring than on solving
        data = self.K, self.k, self.free, self.row_unit, self.unit, P.v_unit, P.equality_scale
        error: float = kernel.error_with(*data, x, *np.empty((2, x.size)))
        return error if math.isfinite(error) else math.inf


def mixed(problem: LCP | MLCP) -> MLCP:
    """Return an LCP as an MLCP without free unknowns."""
    if isinstance(problem, MLCP):
        return problem
    M, m, zeros = problem.M, problem.q.size, matrices.zeros
    return MLCP(A=zeros(0, 0, M), B=M, C=zeros(0, m, M), D=zeros(m, 0, M), a=np.zeros(0), b=problem.q)


def scale(problem: MLCP, *, keep_sparse: bool = False) -> ScaledMLCP:
    """Return the scaled data, K dense unless `keep_sparse` and one of the four matrices is sparse."""
    P, n, N = problem, problem.a.size, problem.a.size + problem.b.size
    stored = P.A, P.B, P.C, P.D
    if not (keep_sparse and any(map(matrices.is_sparse, stored))):
        K, (k, unit, row_unit) = np.empty((N, N)), np.empty((3, N))
        kernel = mlcp_scaling.scaled
        kernel(*map(dense, stored), P.a, P.b, PASSES, K, k, unit, row_unit)
        return ScaledMLCP(problem, K, k, n, unit, row_unit)
    K, k = matrices.block([[P.A, P.C], [P.D, P.B]]), np.concatenate([P.a, P.b])
    row, column = equilibration(K, n)
    K = sp.csr_array(K, copy=True)
    K.data *= np.repeat(row, np.diff(K.indptr)) * column[K.indices]
    size = float(matrices.power_of_two(np.array([max_abs(row * k) or 1.0]))[0])
    return ScaledMLCP(problem, K, size * row * k, n, column / size, 1.0 / (size * row))


def equilibration(K: Any, n: int) -> tuple[Any, Any]:
    """Return powers of 2 for rows and columns of K, the first n apart, or of each dense K of a stack (k, N, N)."""
    sizes: Any = np.abs(K.data) if matrices.is_sparse(K) else np.abs(K)
    row: Any
    column: Any
    row, column = np.ones((2, *K.shape[:-1]))
    for _ in range(PASSES):
        tops = _tops(K, sizes, row, column)
        by_row, by_column = (1.0 / np.sqrt(np.where(top > 0.0, top, 1.0)) for top in tops)
        # one factor for row and column of a pair: v ⟂ w are scaled together, and B stays what it is, definite or a
        # P-matrix
        by_row[..., n:] = by_column[..., n:] = np.sqrt(by_row[..., n:] * by_column[..., n:])
        row *= by_row
        column *= by_column
    return matrices.power_of_two(1.0 / row), matrices.power_of_two(1.0 / column)


def _tops(K: Any, sizes: Any, row: Any, column: Any) -> tuple[Any, Any]:
    """Return the largest entry of every row and column of the scaled |K|, whose entries are `sizes`."""
    if not matrices.is_sparse(K):
        scaled = sizes * row[..., :, None] * column[..., None, :]
        return scaled.max(axis=-1, initial=0.0), scaled.max(axis=-2, initial=0.0)
    at = np.repeat(np.arange(row.size), np.diff(K.indptr))
    scaled = sizes * row[at] * column[K.indices]
    tops = np.zeros((2, row.size))
    np.maximum.at(tops[0], at, scaled)
    np.maximum.at(tops[1], K.indices, scaled)
    return tops[0], tops[1]


def dense_obstacle(problem: MLCP) -> str | None:
    """Return why a dense [[A, C], [D, B]] is out of the question, else None."""
    return size_obstacle(problem.a.size + problem.b.size)


def refined(prepared: ScaledMLCP, x: Vector, error: float, tolerance: float) -> tuple[Vector, float]:
    """Return x or what a step of iterative refinement on the free unknowns and the positive v makes of it, and its
    error.

    By LU and, where that is not within the tolerance, by least squares without the directions in which the matrix of
    these unknowns is singular: a rounding error in the rows would be enlarged along them.
    """
    basis = np.flatnonzero((np.arange(x.size) < prepared.free) | (x > 0.0))
    part = principal(prepared.K, basis)
    # least squares are dear: only where LU was not enough
    for solve in (solve_linear, _least_squares):
        step = solve(part, -(prepared.K @ x + prepared.k)[basis])
        if step is not None:
            better = np.array(x)
            better[basis] += step
            better[prepared.free :] = np.maximum(better[prepared.free :], 0.0)
            if (least := prepared.error(better)) < error:
                x, error = better, least
        if error <= tolerance:
            break
    return x, error


def settled(prepared: ScaledMLCP, x: Vector, error: float, tolerance: float) -> tuple[Vector, float]:
    """Return x, whose error is within the tolerance, or the solution of the equations of its active set (the unknowns
    that are free or above their rows), and its error: whichever has the smaller one.

    A norm over all rows lets one that is small beside the others be wrong in all of its digits; the active set is
    right long before. An x that has three digits more than were asked for is left alone.
    """
    if not WORTH * tolerance < error <= tolerance:
        return x, error
    n = prepared.free
    w = (prepared.K @ x + prepared.k)[n:]
    near = np.array(x)
    near[n:] = np.where(x[n:] > w, x[n:], 0.0)
    better = refined(prepared, near, prepared.error(near), WORTH * tolerance)[0]
    error, least = prepared.error(x, tolerance), prepared.error(better, tolerance)
    return (better, least) if least < error else (x, error)


def _least_squares(A: Matrix, b: Vector) -> Vector | None:
    """Return the shortest x with the least ‖Ax − b‖, None for a matrix too large for singular values."""
    if b.size > SINGULAR_VALUES:
        return None
    result: Any = np.linalg.lstsq(dense(A), b, rcond=SINGULAR)[0]
    return result


def conclude(
    prepared: ScaledMLCP,
    x: Vector,
    budget: Budget,
    counters: Mapping[str, int],
    *,
    error: float | None = None,
    otherwise: Claim | None = None,
    message: str = "",
) -> SolverOutput:
    """Claim solved exactly when the judged error of x is at most the tolerance; else `otherwise`."""
    if error is None or error <= budget.tolerance:
        error = prepared.error(x, budget.tolerance)
    return concluded(prepared.point(x), error, budget, counters, otherwise, message)


def farkas(prepared: ScaledMLCP, budget: Budget) -> Vector | None:
    """Return (y_e, y_v ≥ 0) with Aᵀy_e + Dᵀy_v = 0, Cᵀy_e + Bᵀy_v ≤ 0, aᵀy_e + bᵀy_v < 0 to rounding; None without."""
    n, N = prepared.free, prepared.k.size
    columns: Any = prepared.K.T
    y = linear_program.multipliers(
        prepared.k,
        budget,
        A_ub=columns[n:],
        b_ub=np.zeros(N - n),
        A_eq=columns[:n] if n else None,
        b_eq=np.zeros(n) if n else None,
        # a certificate times any number is one: bounds of 1 keep the program bounded
        bounds=[(-1.0 if i < n else 0.0, 1.0) for i in range(N)],
    )
    if y is None:
        return None
    y = y / prepared.row_unit
    y[n:] = np.maximum(y[n:], 0.0)
    return y if prepared.problem.certifies_infeasibility(y) else None
