"""Bounds on the distance between two verified answers of a problem with one solution.

The problem is an affine variational inequality over a box: z is free or between bounds, w = Mz + q. An answer that
is verified at the tolerance ε misses, row by row, by at most SLACK ε of the terms of w, or by SLACK ε of the size of z.
Two matrices give a bound on the distance of such an answer from the only solution z*, with r = z − Π(z − w), Π the
projection on the box:

- M positive definite: ‖z − z*‖₂ ≤ (L + 1)/c ‖r‖₂, c the least eigenvalue of (M + Mᵀ)/2, L ≥ ‖M‖₂ (Facchinei and
  Pang, Finite-Dimensional Variational Inequalities, 2003, proposition 6.3.1). It is used for w/L in place of w, so that
  L = 1, and with unknowns in units in which M has a unit diagonal, which change neither the solutions nor the box.
- M with a comparison matrix ⟨M⟩ that has a nonnegative inverse (an H-matrix with a positive diagonal, which is a
  P-matrix): ‖z − z*‖∞ ≤ ‖⟨M⟩⁻¹‖∞ ‖r‖∞ with every row of w divided by its diagonal entry (Chen and Xiang, Computation
  of error bounds for P-matrix linear complementarity problems, Math. Programming 106, 2006).

For another P-matrix no computable bound is known, and there is no result.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from cpbench.formulations import AVI, LCP, MLCP, QP
from cpbench.formulations.base import Problem
from cpbench.formulations.linear import Relay
from cpbench.formulations.programs import QPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector, max_abs

SLACK = 10.0
"""Largest miss of a row by a verified answer, in tolerances in the units of this module: those of the judge differ."""
LARGEST = 500
"""Unknowns up to which eigenvalues are computed."""
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class AnswerDistance:
    """The distance of two answers over the larger size, the largest that right ones may have, and why there is one
    solution."""

    distance: float
    allowed: float
    fact: str


def affine_box(problem: Problem, point: Any) -> tuple[Matrix, Vector, Vector] | None:
    """Return M, q and z where the problem is an affine variational inequality over a box, else None."""
    if isinstance(problem, MLCP):
        M = matrices.block([[problem.A, problem.C], [problem.D, problem.B]])
        return M, np.concatenate([problem.a, problem.b]), np.concatenate([point.u, point.v])
    if isinstance(problem, LCP | Relay) or (isinstance(problem, AVI) and problem.only_box):
        return problem.M, problem.q, point.z
    return None


def apart(M: Matrix, q: Vector, one: Vector, other: Vector, tolerance: float) -> AnswerDistance | None:
    """Return how far apart two answers verified at `tolerance` are, and may be, by the bound that allows least; None
    where no bound is known, or where it would allow the distance whatever the matrix is.

    Parameters
    ----------
    M, q : (n, n) and (n,). one, other : answers, (n,).
    """
    if not (np.asarray(M.diagonal()) > 0.0).all() or not (one.any() or other.any()):
        return None
    bounds = [by_bound(M, q, one, other, tolerance) for by_bound in (_by_comparison, _by_definiteness)]
    known = [result for result in bounds if result is not None]
    return max(known, key=lambda result: result.distance / result.allowed, default=None)


def _by_definiteness(M: Any, q: Vector, one: Vector, other: Vector, tolerance: float) -> AnswerDistance | None:
    s = 1.0 / np.sqrt(np.asarray(M.diagonal()))
    S, L = _scaled(M, s)
    points = one / s, other / s
    sizes = [matrices.norm(x) + matrices.norm(S @ abs(x) + abs(s * q)) / L for x in points]
    norms = max(map(matrices.norm, points))
    missed, distance = SLACK * tolerance * sum(sizes), matrices.norm(points[0] - points[1])
    # the cheap part first: the factor of no matrix is less than 2
    factor = definite_factor(M) if distance > 2.0 * missed else None
    return (
        None if factor is None else AnswerDistance(distance / norms, factor * missed / norms, "M is positive definite")
    )


def definite_factor(M: Any) -> float | None:
    """Return 2L/c in units in which M (n, n) has a unit diagonal, which is positive, so that a point is no farther from
    the solution than this times ‖z − Π(z − w/L)‖₂; None where M is not positive definite beyond rounding, or large."""
    n = M.shape[0]
    if n > LARGEST:
        return None
    L = _scaled(M, 1.0 / np.sqrt(np.asarray(M.diagonal())))[1]
    least = matrices.least_eigenvalue(M) - n * EPS * L
    return 2.0 * L / least if least > 0.0 else None


def _scaled(M: Any, s: Vector) -> tuple[Any, float]:
    """Return |diag(s) M diag(s)|, and a bound on the 2-norm of what it is the absolute value of."""
    S: Any = abs(matrices.scaled_both(M, s))
    return S, float(np.sqrt(S.sum(axis=0).max() * S.sum(axis=1).max()))


def _by_comparison(M: Any, q: Vector, one: Vector, other: Vector, tolerance: float) -> AnswerDistance | None:
    diagonal, size = np.asarray(M.diagonal()), abs(M)
    terms = [float(((size @ abs(x) + abs(q)) / diagonal).max()) for x in (one, other)]
    largest = [matrices.max_abs(x) for x in (one, other)]
    missed, distance = SLACK * tolerance * sum(map(max, terms, largest)), matrices.max_abs(one - other)
    # the factor of no matrix is less than 1
    factor = comparison_factor(M) if distance > missed else None
    top = max(largest)
    return None if factor is None else AnswerDistance(distance / top, factor * missed / top, "M is an H-matrix")


def comparison_factor(M: Any) -> float | None:
    """Return ‖⟨M⟩⁻¹‖∞ of M (n, n) with its rows divided by their diagonal entries, which are positive, so that no
    component of a point is farther from the solution than this times max|z − Π(z − w/diag(M))|; None where the inverse
    has negative entries."""
    scaled = sp.csr_array(abs(M)) * (1.0 / np.asarray(M.diagonal()))[:, None]
    # 1 on the diagonal, −|M_ij|/M_ii beside it
    comparison: Any = sp.csc_array(2.0 * sp.eye_array(M.shape[0]) - scaled)
    try:
        sums = spla.splu(comparison).solve(np.ones(M.shape[0]))
    except RuntimeError:  # singular
        return None
    # x > 0 with ⟨M⟩x > 0: the inverse is not negative, and its largest row sum is max(x)
    return float(sums.max()) if ((sums > 0.0) & (comparison @ sums > 0.5)).all() else None


# ----------------------------------------------------------------------------------------------------------- optimality


def meets_conditions(program: QP, x: QPPoint, share: float) -> bool:
    """Return whether a point misses no condition of Karush, Kuhn and Tucker by more than `share`.

    A row may be missed by its share of |b_i|, and of its largest entry times the largest unknown; a bound by that of
    the largest unknown; a component of stationarity by that of |p_j|, of the largest entry of its column of Q times the
    largest unknown, and of that of A, C and the bounds times the largest multiplier, in units in which the largest
    entry of a row is 1; the gap between primal and dual objective by that of |f|. Multipliers have the right sign.
    """
    return _feasible(program, x, share) and _stationary(program, x, share) and _no_gap(program, x, share)


def _rows(program: QP) -> Any:
    return matrices.sparse(matrices.block([[program.A], [program.C]]))


def _feasible(program: QP, x: QPPoint, share: float) -> bool:
    rows, m, top = _rows(program), program.b.size, max_abs(x.z)
    sides = np.concatenate([program.b, program.d])
    missed = sides - rows @ x.z
    missed[m:] = abs(missed[m:])
    allowed = share * (abs(rows).max(axis=1).toarray().ravel() * top + abs(sides))
    within = (program.lb - x.z <= share * top) & (x.z - program.ub <= share * top)
    return bool((missed <= allowed).all() and within.all())


def _stationary(program: QP, x: QPPoint, share: float) -> bool:
    rows, multipliers = _rows(program), np.concatenate([x.lam, x.mu])
    size = abs(rows).max(axis=1).toarray().ravel()
    unit_rows: Any = sp.diags_array(1.0 / np.where(size > 0.0, size, 1.0)) @ abs(rows)
    force = max(max_abs(multipliers * size), max_abs(x.nu))
    columns = np.maximum(unit_rows.max(axis=0).toarray().ravel(), x.nu != 0.0)
    Q = abs(matrices.sparse(program.Q)).max(axis=1).toarray().ravel()
    missed = program.Q @ x.z + program.p - rows.T @ multipliers - x.nu
    return bool((abs(missed) <= share * (Q * max_abs(x.z) + abs(program.p) + columns * force)).all())


def _no_gap(program: QP, x: QPPoint, share: float) -> bool:
    at = x.nu != 0.0
    bounds = np.where(x.nu > 0.0, program.lb, program.ub)[at]
    if (x.lam < 0.0).any() or not np.isfinite(bounds).all():
        return False
    dual = program.b @ x.lam + program.d @ x.mu + bounds @ x.nu[at]
    gap = x.z @ (program.Q @ x.z) + program.p @ x.z - dual
    return bool(abs(gap) <= share * abs(program.objective(x.z)))


def objective_unit(program: Any) -> float:
    """Return the size of an objective by the data alone, the same in all units of unknowns: Σ p_i²/Q_ii, and |p_i|
    times the larger finite bound of an unknown with Q_ii = 0; 0 where there is neither."""
    diagonal, p = np.asarray(program.Q.diagonal()), program.p
    curved = diagonal > 0.0
    unit = float((p[curved] ** 2 / diagonal[curved]).sum())
    if isinstance(program, QP):
        bounds = np.maximum(*(np.where(np.isfinite(bound), abs(bound), 0.0) for bound in (program.lb, program.ub)))
        unit += float(abs(p[~curved]) @ bounds[~curved])
    return unit
