"""A certificate for an answer: proved where the problem is polyhedral, else enclosed in a box."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import scipy.sparse as sp
from flint import arb, fmpq_mat, fmpz_mat
from scipy.linalg import lapack, solve_triangular
from scipy.sparse.csgraph import connected_components

from cpbench.formulations.base import Problem
from cpbench.formulations.programs import QP
from cpbench.foundation.matrices import Sparse, Vector
from cpbench.verification.verdict import error_of
from cpbench_lab.certificates import polyhedral
from cpbench_lab.certificates.active_sets import States
from cpbench_lab.certificates.all_solutions import AllSolutions, all_solutions
from cpbench_lab.certificates.basic_points import ExactPoint, violations
from cpbench_lab.certificates.basic_points import exact_point as point_of_states
from cpbench_lab.certificates.certificate import (
    DISTANT,
    ENCLOSED,
    MEASURED,
    PROVED,
    REFUTED,
    STATIONARY,
    TOLERANCE,
    Certificate,
)
from cpbench_lab.certificates.contact_balls import Scene, enclose_contacts
from cpbench_lab.certificates.exact_points import rounded, solves_contacts
from cpbench_lab.certificates.exact_rows import ExactRows, nearest, over_one, rational
from cpbench_lab.certificates.krawczyk import balls, digits, up
from cpbench_lab.certificates.mixed import CONTACTS, POLYHEDRAL, Mixed, mixed, point_of_mixed
from cpbench_lab.certificates.nonlinear_boxes import Bounded, enclose_nonlinear, exact_point

ENUMERATION = "enumeration"
"""The fact that makes a solution unique where all bases were looked at."""


def certify(
    problem: Problem, point: Any, seconds: float = 60.0, tolerance: float = TOLERANCE, *, pivots: bool = True
) -> Certificate:
    """Look for a proof that a solution is within `tolerance` of the answer, for about so many seconds; without `pivots`
    of a polyhedral problem at the active sets that doubles show alone.

    Raises PointError when the point is not an answer to the problem.
    """
    problem.check_point(point)
    began = time.perf_counter()
    answer = point.vector
    plain = Certificate(problem.node, problem.fingerprint, MEASURED, answer, tolerance=tolerance)
    with np.errstate(all="ignore"):  # doubles give hints only; answers may be as large as doubles go
        found = _certified(problem, point, plain, seconds, pivots)
    return replace(found, level=_level(problem, point, found), seconds=time.perf_counter() - began)


def at_solution(problem: Problem, known: Certificate) -> tuple[Any, Certificate]:
    """Return the exact solution that a certificate of a polyhedral problem knows, rounded, with the same proof."""
    exact: Any = known.exact
    point = point_of_mixed(problem, np.array([nearest(value) for value in exact]))
    form = mixed(problem, point)
    assert form is not None
    distance = _distance(form[0], _compared(problem, point), exact)
    certificate = replace(known, level=PROVED, answer=point.vector, distance=distance)
    return point, replace(certificate, level=_level(problem, point, certificate))


def _level(problem: Problem, point: Any, certificate: Certificate) -> str:
    """Return the level of an answer by its distance; of rows z alone is compared, since multipliers may be many, and
    wrong ones are seen by the error."""
    off = problem.node in ("qp", "avi") and point.finite and error_of(problem, point).error > certificate.tolerance
    if certificate.level in (PROVED, ENCLOSED) and (certificate.distance > certificate.tolerance or off):
        return DISTANT
    if (
        certificate.level == PROVED
        and isinstance(problem, QP)
        and not (certificate.unique or certificate.convex or problem.convex)
    ):
        return STATIONARY
    return certificate.level


def _certified(problem: Problem, point: Any, plain: Certificate, seconds: float, pivots: bool) -> Certificate:
    if not point.finite:
        return replace(plain, reason="the answer is not finite")
    form = mixed(problem, point)
    if form is not None:
        return _proved(problem, point, *form, plain, seconds, pivots)
    if problem.node in CONTACTS:
        return _contacts(problem, point, plain, seconds)
    P = Bounded.of(problem)
    if P is None:
        return replace(plain, reason=f"no proof is known for {problem.node}")
    box = enclose_nonlinear(P, point.z)
    if not box.reason:
        return _boxed(plain, box, point.z, slice(None))
    near = exact_point(P, point.z)
    return replace(plain, reason=box.reason) if near is None else _at(plain, near, point.z, slice(None))


def _contacts(problem: Problem, point: Any, plain: Certificate, seconds: float) -> Certificate:
    scene, x = Scene.of(problem, point)
    box, compared = enclose_contacts(scene, x, seconds), slice(scene.k, None)
    if not box.reason:
        return _boxed(plain, box, x, compared)
    for near in rounded(x):
        if solves_contacts(scene, near):
            return _at(plain, near, x, compared)
    return replace(plain, reason=box.reason)


def _boxed(plain: Certificate, box: Any, x: Vector, compared: slice) -> Certificate:
    """Return a box as a certificate, with the distance of the answer's part from the farthest point of the box."""
    with digits():
        there = balls(box.centre, box.radius)[compared]
        away = arb(max((up(v - arb(a)) for v, a in zip(there, x[compared].tolist(), strict=True)), default=0.0))
        size = arb(max((float(v.abs_lower()) for v in there), default=0.0) * (1 - 1e-15))
        distance = up(away / size if size > 0 else away)
    names = ("states", "dropped", "centre", "radius")
    return replace(plain, level=ENCLOSED, distance=distance, evidence={name: getattr(box, name) for name in names})


def _at(plain: Certificate, near: Vector, x: Vector, compared: slice) -> Certificate:
    """Return an exact point of doubles as a certificate."""
    pairs = zip(near[compared].tolist(), x[compared].tolist(), strict=True)
    away = max((abs(rational(a) - rational(b)) for a, b in pairs), default=rational(0.0))
    size = rational(float(np.abs(near[compared]).max(initial=0.0)))
    distance = math.nextafter(nearest(away / size if size else away), math.inf) if away else 0.0
    return replace(plain, level=PROVED, distance=distance, evidence={"point": near})


def _proved(
    problem: Problem, point: Any, P: Mixed, x: Vector, plain: Certificate, seconds: float, pivots: bool
) -> Certificate:
    size = P.answer.shape[0]
    unique = _unique(problem) if problem.node in POLYHEDRAL else ""
    every, uncounted = None if unique else all_solutions(problem), plain
    if every is not None:
        plain = _counted(plain, every)
        if every.count == 0:
            return replace(plain, level=REFUTED)
    found, answer = polyhedral.prove(P, x, seconds, pivots=pivots), _compared(problem, point)
    distance = math.inf if found.support is None else _distance(P, answer, found.x)
    if every is not None and every.points:
        near, states = min(every.points, key=lambda own: _distance(P, answer, own[0]))
        if _distance(P, answer, near) < distance:
            nearer = _of_basis(P, near, states)
            # with a number of solutions the distance is that from the nearest
            plain, found = (uncounted, found) if nearer is None else (plain, nearer)
            distance = math.inf if found.support is None else _distance(P, answer, found.x)
    if found.support is None:
        return replace(plain, reason=found.reason)
    evidence = {**plain.evidence, **vars(found.support)}
    unique = unique or (ENUMERATION if plain.solutions == 1 else "")
    plain = replace(plain, level=PROVED, distance=distance, unique=unique, evidence=evidence, exact=found.x)
    if not isinstance(problem, QP):
        return plain
    Q = sp.csr_array(P.K[:size][:, :size])
    low, high = objective_bounds(Q, problem.p, found.x[:size])
    return replace(plain, convex=unique or convexity(Q), value_low=low, value_high=high)


@lru_cache(maxsize=1)
def _unique(problem: Problem) -> str:
    """Return the fact that makes a solution unique; of a problem, whose answers are several, it is looked for once."""
    form = mixed(problem, problem.zero_point())
    assert form is not None
    P = form[0]
    size = P.answer.shape[0]
    return uniqueness(sp.csr_array(P.K[:size][:, :size]), box=size == P.c.size)


def objective_bounds(Q: Sparse, p: Vector, z: Sequence[Any]) -> tuple[float, float]:
    """Return the doubles around ½zᵀQz + pᵀz, equal where it is one; z : (n,) rationals."""
    numerators, common = over_one(z)
    numbers = [rational(float(v)) for v in p.tolist()]
    linear = sum((a * b for a, b in zip(numbers, numerators, strict=True)), rational(0.0))
    rows = ExactRows.of(Q).products(numerators)
    square = sum((a * b for a, b in zip(rows, numerators, strict=True)), rational(0.0))
    value = (linear + square / (2 * common)) / common
    near = nearest(value)
    if rational(near) == value:
        return near, near
    if rational(near) < value:
        return near, math.nextafter(near, math.inf)
    return math.nextafter(near, -math.inf), near


def _counted(plain: Certificate, every: AllSolutions) -> Certificate:
    """Return the certificate with the number of all solutions, and with them, or with the states of a face of many."""
    if every.endless is not None:
        return replace(plain, solutions=every.count, evidence={"endless": every.endless})
    doubles = [[nearest(v) for v in x] for x, _ in every.points]
    listed = np.array(doubles, dtype=np.float64).reshape(len(doubles), plain.answer.size)
    return replace(plain, solutions=every.count, evidence={"solutions": listed})


def _of_basis(P: Mixed, x: Sequence[Any], states: States) -> ExactPoint | None:
    """Return a solution as the exact point of its states; None where these leave it open."""
    K = ExactRows.of(P.K)
    found = point_of_states(P, K, states, np.array([nearest(v) for v in x]))
    return found if found.support is not None and not violations(P, K, found.x) else None


def _compared(problem: Problem, point: Any) -> Vector:
    """Return what of the answer is compared with the exact point."""
    if problem.node == "mlcp":
        return np.concatenate([point.u, point.v])
    return point.z if problem.node in POLYHEDRAL else point.r


def _distance(P: Mixed, answer: Vector, exact: Any) -> float:
    """Return ‖answer − S·exact‖∞/‖S·exact‖∞ of the part of the answer where it is largest, rounded up.

    A part that is 0 is measured by the size of the whole, absolute where that is 0 too.
    """
    rows: Any = P.answer
    away, size = [rational(0.0)] * len(P.parts), [rational(0.0)] * len(P.parts)
    pointers = list(pairwise(rows.indptr.tolist()))
    for k, (first, last) in enumerate(P.parts):
        for here, (a, b) in zip(answer[first:last].tolist(), pointers[first:last], strict=True):
            pairs = zip(rows.indices[a:b].tolist(), rows.data[a:b].tolist(), strict=True)
            there = sum((exact[j] * int(sign) for j, sign in pairs), rational(0.0))
            away[k], size[k] = max(away[k], abs(there - rational(here))), max(size[k], abs(there))
    whole = max(size) or rational(1.0)
    largest = max(a / (b or whole) for a, b in zip(away, size, strict=True))
    return math.nextafter(nearest(largest), math.inf) if largest else 0.0


# ----------------------------------------------------------------------------------------------------- unique solutions
# Facts of a matrix that make a solution unique, or a program convex, decided in exact arithmetic.
#
# Doubles give the witness; integers decide. Both facts are of the problem, not of an answer.

LARGEST = 1200
"""Rows of the largest matrix that is looked at."""
P_MATRIX, DEFINITE, SEMIDEFINITE = "P-matrix", "positive definite", "positive semidefinite"


def uniqueness(M: Sparse, *, box: bool) -> str:
    """Name the fact by which a problem with this matrix has one solution at most, '' where none is found.

    A P-matrix is enough over a `box`; a definite matrix over every convex set.
    """
    if not 0 < M.shape[0] <= LARGEST:
        return ""
    return P_MATRIX if box and dominant(M) else DEFINITE if definite(M) else ""


def dominant(M: Sparse) -> bool:
    """Return whether M is an H-matrix with positive diagonal, hence a P-matrix.

    Exactly: Mᵢᵢwᵢ > Σ|Mᵢⱼ|wⱼ for some w > 0.

    (Berman, Plemmons: Nonnegative Matrices in the Mathematical Sciences, 1994, chapter 6.)
    """
    dense: Any = M.toarray()
    diagonal = np.diag(dense).copy()
    if not (diagonal > 0).all():
        return False
    compared = -np.abs(dense)
    np.fill_diagonal(compared, diagonal)
    try:
        w = np.linalg.solve(compared, diagonal)
    except np.linalg.LinAlgError:
        return False
    if not (np.isfinite(w).all() and (w > 0).all()):
        return False
    integers, weights = integer_matrix(compared), integer_matrix(w[:, None])
    return all(value > 0 for value in (integers * weights).entries())


def definite(M: Sparse) -> bool:
    """Return whether M + Mᵀ is positive definite: X(M + Mᵀ)Xᵀ is strictly diagonally dominant, exactly, for some X.

    X is the inverse of a Cholesky factor in doubles (after Rump: Verification of positive definiteness, BIT 46, 2006).
    Were X singular, the product would be so too, which a dominant matrix is not.
    """
    dense: Any = M.toarray()
    diagonal = np.diag(dense)
    if not (diagonal > 0).all():
        return False
    # powers of two, so that the scaled matrix is the same number for number
    scale = np.ldexp(1.0, -(np.frexp(diagonal)[1] // 2))
    scaled = dense * scale[:, None] * scale[None, :]
    if not np.isfinite(scaled).all() or ((scaled == 0) & (dense != 0)).any():
        return False
    try:
        factor = np.linalg.cholesky(scaled + scaled.T)
    except np.linalg.LinAlgError:
        return False
    inverse = solve_triangular(factor, np.eye(len(diagonal)), lower=True, check_finite=False)
    if not np.isfinite(inverse).all():
        return False
    X, half = integer_matrix(inverse, 40), integer_matrix(scaled)
    product: Any = X * (half + half.transpose()) * X.transpose()
    return all(2 * row[i] > sum(map(abs, row)) for i, row in enumerate(product.tolist()))


def convexity(Q: Sparse) -> str:
    """Name the fact that makes a symmetric matrix positive semidefinite, '' where none is found: each of its connected
    components is a number ≥ 0 or is shown to be so."""
    count, label = connected_components(sp.csr_matrix(Q), directed=False)
    if (Q.diagonal() < 0).any():
        return ""
    order = np.argsort(label, kind="stable")
    parts = np.split(order, np.cumsum(np.bincount(label, minlength=count))[:-1])
    larger = [sp.csr_array(Q[part][:, part]) for part in parts if part.size > 1]
    if all(M.shape[0] <= LARGEST and definite(M) for M in larger) and (Q.diagonal() > 0).all():
        return DEFINITE
    fits = all(M.shape[0] <= LARGEST and (definite(M) or semidefinite(M)) for M in larger)
    return SEMIDEFINITE if fits else ""


def semidefinite(M: Sparse) -> bool:
    """Return whether a symmetric matrix is positive semidefinite: a block of its rows and columns is positive definite,
    and by that block, exactly, nothing is left of the others (its Schur complement is 0)."""
    dense: Any = M.toarray()
    if (dense != dense.T).any():
        return False
    _, pivots, rank, _ = lapack.dpstrf(dense, tol=-1.0)
    some, others = pivots[:rank] - 1, pivots[rank:] - 1
    if not (0 < rank < len(dense) and definite(sp.csr_array(dense[np.ix_(some, some)]))):
        return False
    whole = integer_matrix(dense).tolist()

    def block(rows: Any, columns: Any) -> Any:
        return fmpq_mat(fmpz_mat([[whole[i][j] for j in columns.tolist()] for i in rows.tolist()]))

    rest = block(others, some) * block(some, some).solve(block(some, others), algorithm="dixon")
    return rest == block(others, others)


def integer_matrix(dense: Any, bits: int | None = None) -> Any:
    """Return the matrix times a power of two, exact; with `bits`, rounded to as many digits of its largest entry."""
    mantissas, exponents = np.frexp(dense)
    least = int(exponents[dense != 0].min()) - 53 if (dense != 0).any() else 0
    if bits is not None:
        least = int(np.frexp(np.abs(dense).max())[1]) - bits
        rounded = np.rint(np.ldexp(dense, -least)).astype(np.int64)
        return fmpz_mat(rounded.tolist())
    whole = (mantissas * 2.0**53).astype(np.int64).ravel().tolist()
    shifts = (exponents.astype(np.int64) - 53 - least).ravel().tolist()
    entries = [value << shift if value else 0 for value, shift in zip(whole, shifts, strict=True)]
    return fmpz_mat(*dense.shape, entries)
