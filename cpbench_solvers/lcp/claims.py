"""Base of the LCP solvers: the data scaled to size one, one step of refinement, and the last word on a claim."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation.factorization import sparse_lu
from cpbench.foundation.matrices import Matrix, Vector, dense, max_abs, sparse
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput
from cpbench_solvers import linear_program
from cpbench_solvers.avi.claims import verdict_error
from cpbench_solvers.kernels import lcp_error

CLOSE = 100.0
"""A method that ended regularly within this factor of the tolerance claims `inaccurate`, beyond it `failed`."""
WORTH = 1e-3
"""Share of the tolerance below which an error is that of a method that has converged."""
DENSE_BYTES = 4e9
"""The largest dense matrix a solver that needs one takes on."""


@dataclass(frozen=True)
class ScaledLCP:
    """The LCP of M/m and q/p, m = max|M|, p = max|q|, so that pivot tolerances have a meaning; z is p/m times its z.

    Attributes
    ----------
    problem : the LCP that was asked. M : (n, n). q : (n,). z_unit : p/m.
    """

    problem: LCP
    M: Matrix
    q: Vector
    z_unit: float


def scale(problem: LCP, *, keep_sparse: bool = False) -> ScaledLCP:
    """Return the scaled data, M dense unless `keep_sparse`."""
    m = max_abs(problem.M) or 1.0
    p = max_abs(problem.q) or 1.0
    M = problem.M if keep_sparse else dense(problem.M)
    return ScaledLCP(problem, M / m, problem.q / p, p / m)


def dense_obstacle(problem: LCP) -> str | None:
    """Return why a dense copy of M is out of the question, else None."""
    return size_obstacle(problem.q.size)


def size_obstacle(n: int, instead: str = "a sparse solver") -> str | None:
    """Return why a dense (n, n) matrix is out of the question, and what to use instead; else None."""
    size = 8.0 * n * n
    if size <= DENSE_BYTES:
        return None
    return f"needs a dense {n}x{n} matrix ({size / 1e9:.1f} GB, at most {DENSE_BYTES / 1e9:.0f}): use {instead}"


def solve_linear(A: Matrix, b: Vector) -> Vector | None:
    """Return A⁻¹b by LU, None when a pivot is exactly zero or the result is not finite."""
    if b.size == 0:
        return b
    if sp.issparse(A):
        lu = sparse_lu(A)
        if lu is None:
            return None
        x = lu.solve(b)
    else:
        _, _, x, info = lapack.dgesv(A, b)
        if info != 0:
            return None
    return x if np.isfinite(x).all() else None


def principal(M: Matrix, active: np.ndarray[Any, Any]) -> Matrix:
    """Return M_FF for the indices F in `active`."""
    return M[active][:, active] if sp.issparse(M) else M[np.ix_(active, active)]


def refined(M: Matrix, q: Vector, z: Vector, active: np.ndarray[Any, Any]) -> Vector:
    """Take one step of iterative refinement of M_FF z_F = -q_F, F = `active`; z itself where M_FF is singular."""
    better = np.zeros_like(z)
    better[active] = z[active]
    step = solve_linear(principal(M, active), -(M @ better + q)[active])
    if step is None:
        return z
    better[active] += step
    return np.maximum(better, 0.0)


def guessed(lcp: ScaledLCP, z: Vector) -> np.ndarray[Any, Any]:
    """Return the components that are positive in the solution near to z: where z > w, for rounding may be above 0."""
    return z > lcp.M @ z + lcp.q


def settled(
    problem: LCP, z: Vector, active: np.ndarray[Any, Any], tolerance: float, counters: dict[str, int]
) -> tuple[Vector, float]:
    """Return a z within the tolerance, or the basic solution of its active set, and its error: whichever has the
    smaller one; any other z as it is.

    A norm over all rows lets one that is small beside the others be wrong in all of its digits; the active set is
    right long before. A z that has three digits more than were asked for is left alone.
    """
    error = error_of(problem, z)
    if not WORTH * tolerance < error <= tolerance:
        return z, error
    counters["factorizations"] = counters.get("factorizations", 0) + 1
    better = refined(problem.M, problem.q, z, active)
    error, least = (error_of(problem, x, tolerance) for x in (z, better))
    return (better, least) if least < error else (z, error)


def farkas(problem: LCP, budget: Budget) -> Vector | None:
    """Return a y with y ≥ 0, Mᵀy ≤ 0, qᵀy < 0 to rounding, from min qᵀy over 0 ≤ y ≤ 1; None where there is none."""
    n, sums = problem.q.size, np.asarray(problem.M.sum(axis=1)).ravel()
    # z = t(1, …, 1) is feasible for large t, as in games: no certificate can exist
    if np.all((sums > 0.0) | ((sums == 0.0) & (problem.q >= 0.0))):
        return None
    c, A = problem.q / (max_abs(problem.q) or 1.0), problem.M.T / (max_abs(problem.M) or 1.0)
    y = linear_program.multipliers(c, budget, A_ub=A, b_ub=np.zeros(n), bounds=(0.0, 1.0))
    if y is None:
        return None
    y = np.maximum(y, 0.0)
    return y if problem.certifies_infeasibility(y) else None


def error_of(problem: LCP, z: Vector, tolerance: float = -1.0) -> float:
    """Return the error of norms or, of answers within the tolerance, the verdict's if that is larger; infinite where z
    is not finite."""
    M, q, unit, kernel = problem.M, problem.q, problem.z_unit, lcp_error
    if isinstance(M, np.ndarray):
        error = kernel.error_dense(M, q, z, unit)
    else:
        M = sparse(M)
        error = kernel.error_sparse(M.indptr, M.indices, M.data, q, z, unit)
    if error <= tolerance:
        error = max(error, verdict_error(problem, z))
    return error if math.isfinite(error) else math.inf


def conclude(
    problem: LCP,
    z: Vector,
    budget: Budget,
    counters: Mapping[str, int],
    *,
    error: float | None = None,
    otherwise: Claim | None = None,
    message: str = "",
) -> SolverOutput:
    """Claim solved exactly when the judged error of z is at most the tolerance; else `otherwise`.

    `error` : of norms, where the caller has it at hand.
    """
    if error is None or error <= budget.tolerance:
        error = error_of(problem, z, budget.tolerance)
    return concluded(LCPPoint(z), error, budget, counters, otherwise, message)


def concluded(
    point: Any, error: float, budget: Budget, counters: Mapping[str, int], otherwise: Claim | None, message: str
) -> SolverOutput:
    """Claim solved exactly when the error of the point, of any node, is at most the tolerance; else `otherwise`.

    Without `otherwise` the method has ended regularly: inaccurate when the error is close, failed when not.
    """
    if error <= budget.tolerance:  # finite, so the point is
        return SolverOutput(claim=Claim.SOLVED, point=point, counters=counters)
    if not point.finite:
        return SolverOutput(claim=Claim.FAILED, counters=counters, message=message or "the answer is not finite")
    if otherwise is None:
        otherwise = Claim.INACCURATE if error <= CLOSE * budget.tolerance else Claim.FAILED
        message = message or f"ended at error {error:.1e}, asked for {budget.tolerance:.0e}"
    return SolverOutput(claim=otherwise, point=point, counters=counters, message=message)


def recorded(output: SolverOutput, z: Vector, problem: LCP, record: Record | None, iteration: int) -> SolverOutput:
    """Return a conclusion; where its answer is not z, the last that was recorded, it is recorded as that iteration."""
    if record is not None and isinstance(output.point, LCPPoint) and not np.array_equal(output.point.z, z):
        record(iteration, error_of(problem, output.point.z), partial(LCPPoint, output.point.z))
    return output


def after_ray(
    counters: dict[str, int], certificate: Vector | None, proves: str, what: str = "ray"
) -> tuple[SolverOutput | None, str]:
    """Return the claim that there is no solution where a certificate `proves` it, else None, for a ray proves nothing
    by itself; and the message of a method that ended so."""
    after = f"{what} after {counters['pivots']} pivots"
    if certificate is None:
        return None, f"{after}, and no certificate of infeasibility: undecided"
    message = f"{after}; {proves} to rounding (Farkas)"
    output = SolverOutput(claim=Claim.INFEASIBLE, counters=counters, certificate=certificate, message=message)
    return output, message


def ended_in_basis(
    problem: LCP, z: Vector, F: np.ndarray[Any, Any], budget: Budget, counters: dict[str, int]
) -> SolverOutput:
    """Return the claim of a method that ended in the basis of F: z, or what one step of refinement makes of it."""
    error = error_of(problem, z, budget.tolerance)
    if not error <= budget.tolerance:
        candidate = refined(dense(problem.M), problem.q, z, F)
        counters["factorizations"] = counters.get("factorizations", 0) + 1
        if (better := error_of(problem, candidate, budget.tolerance)) < error:
            z, error = candidate, better
    return conclude(problem, z, budget, counters, error=error)
