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

For another P-matrix no bound is known that can be computed, and nothing is said.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from cpbench import matrices
from cpbench.formulations import AVI, LCP, MLCP
from cpbench.formulations.base import Problem
from cpbench.formulations.relay import Relay
from cpbench.matrices import Matrix, Vector

SLACK = 10.0
"""How many tolerances a verified answer may miss a row by, in the units of this module: those of the judge differ."""
LARGEST = 500
"""Unknowns up to which eigenvalues are computed."""
EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Apart:
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


def apart(M: Matrix, q: Vector, one: Vector, other: Vector, tolerance: float) -> Apart | None:
    """Return how far apart two answers verified at `tolerance` are, and may be; None where no bound is known, or where
    the best matrix would allow it.

    Parameters
    ----------
    M, q : (n, n) and (n,). one, other : answers, (n,).
    """
    found = [test(M, q, one, other, tolerance) for test in (_comparison, _definite)]
    known = [result for result in found if result is not None]
    return max(known, key=lambda result: result.distance / max(result.allowed, EPS), default=None)


def _definite(M: Any, q: Vector, one: Vector, other: Vector, tolerance: float) -> Apart | None:
    diagonal = np.asarray(M.diagonal())
    if not (diagonal > 0.0).all():
        return None
    s = 1.0 / np.sqrt(diagonal)
    S, force = abs(matrices.scaled_both(M, s)), s * q
    L = float(np.sqrt(abs(S).sum(axis=0).max() * abs(S).sum(axis=1).max()))
    points = one / s, other / s
    sizes = [matrices.norm(x) + matrices.norm(S @ abs(x) + abs(force)) / L for x in points]
    norms = max(map(matrices.norm, points))
    distance, best = matrices.norm(points[0] - points[1]), 2.0 * SLACK * tolerance * sum(sizes)
    # the cheap part first: no matrix allows less
    if not norms or distance <= best or one.size > LARGEST:
        return None
    n = one.size
    least = matrices.least_eigenvalue(M) - n * EPS * L
    if least <= 0.0:
        return None
    return Apart(distance / norms, best * L / least / norms, "M is positive definite")


def _comparison(M: Any, q: Vector, one: Vector, other: Vector, tolerance: float) -> Apart | None:
    diagonal = np.asarray(M.diagonal())
    if not (diagonal > 0.0).all():
        return None
    size = abs(M)
    terms = [float(((size @ abs(x) + abs(q)) / diagonal).max(initial=0.0)) for x in (one, other)]
    largest = [matrices.max_abs(x) for x in (one, other)]
    distance = matrices.max_abs(one - other)
    best = SLACK * tolerance * sum(map(max, terms, largest))
    if not max(largest) or distance <= best:
        return None
    scaled = sp.csr_array(size) * (1.0 / diagonal)[:, None]
    comparison = sp.csc_array(2.0 * sp.eye_array(one.size) - scaled)  # 1 on the diagonal, −|M_ij|/M_ii beside it
    try:
        sums = spla.splu(comparison).solve(np.ones(one.size))
    except RuntimeError:  # singular
        return None
    # x > 0 with ⟨M⟩x > 0: the inverse is not negative, and its largest row sum is max(x)
    if not ((sums > 0.0) & (comparison @ sums > 0.5)).all():
        return None
    return Apart(distance / max(largest), best * 2.0 * float(sums.max()) / max(largest), "M is an H-matrix")
