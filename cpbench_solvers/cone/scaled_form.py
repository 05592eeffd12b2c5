"""Cone programs and cone complementarity problems as one, scaled: Mx + p = Aᵀy, s = Ax + b ∈ K, −y ∈ N_K(s).

With x = u D x̂ and s = u E⁻¹ ŝ, E constant on every factor, the entries of D M D and E A D are about 1, and so are x̂
and ŷ where the problem has one size. A complementarity problem has A = I.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.conic import SOCLCP, ConeQP, ConeQPPoint, SOCLCPPoint
from cpbench.formulations.linear import AVI
from cpbench.formulations.programs import QP
from cpbench.formulations.sizes import least
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.matrices import Matrix, Vector, max_abs
from cpbench_solvers.avi.claims import verdict_error
from cpbench_solvers.qp.claims import ErrorMeasure
from cpbench_solvers.qp.scaling import congruent, equilibrate


@dataclass(frozen=True, eq=False)
class ConicForm:
    """The scaled data.

    Attributes
    ----------
    problem : what is asked. M, p, A, b, K : (n, n), (n,), (m, n), (m,), m rows. answer : of x̂, ŝ ∈ K and ŷ.
    start : x̂ and ŷ of an answer. error : the judged error of an answer.
    """

    problem: ConeQP | SOCLCP
    M: Matrix
    p: Vector
    A: Matrix
    b: Vector
    K: ProductCone
    answer: Callable[[Vector, Vector, Vector], Any]
    start: Callable[[Any], tuple[Vector, Vector]]
    error: Callable[[Any], float]


def judged(problem: ConeQP | SOCLCP, tolerance: float) -> Callable[[Any], float]:
    """Return what measures an answer: by norms (`residuals`) and, where these are within the tolerance, by the gap over
    the objective; as the verdict does where all cones have flat faces, which make it a QP or a problem in a box."""

    @cache
    def flat() -> Callable[[Any], float] | None:
        return _flat(problem)

    def error(point: Any) -> float:
        residual = problem.residuals(point, tolerance).error if point.finite else np.inf
        return max(residual, (flat() or partial(_gap, problem))(point)) if residual <= tolerance else residual

    return error


def _flat(problem: ConeQP | SOCLCP) -> Callable[[Any], float] | None:
    """Return the verdict's error of answers to a problem without other cones than {0}, ℝ and ℝ₊; else None."""
    kind = np.repeat(problem.K.kind, problem.K.size.astype(int))
    if not np.isin(problem.K.kind, (Cone.ZERO, Cone.FREE, Cone.NONNEGATIVE)).all():
        return None
    if isinstance(problem, SOCLCP):
        lb, ub = np.where(kind == Cone.FREE, -np.inf, 0.0), np.where(kind == Cone.ZERO, 0.0, np.inf)
        box = AVI(M=problem.M, q=problem.q, lb=lb, ub=ub)
        return lambda point: verdict_error(box, point.x)
    rows, equations, free = (np.flatnonzero(kind == one) for one in (Cone.NONNEGATIVE, Cone.ZERO, Cone.FREE))
    A, b = problem.A, problem.b
    measure = ErrorMeasure(QP.build(problem.Q, problem.p, A[rows], -b[rows], A[equations], -b[equations]))
    none = np.zeros(problem.p.size)

    def error(point: ConeQPPoint) -> float:
        if point.y[free].any():
            return np.inf
        return measure.verdict((point.x, point.y[rows], point.y[equations], none))

    return error


def _gap(problem: ConeQP | SOCLCP, point: Any) -> float:
    """Return the gap, Σ|⟨s_c, y_c⟩ + σ_c(−y_c)| over the factors of K and that of the gradient, over the objective.

    σ is the support function of balls and cylinders, 0 of cones.
    """
    x, K = point.x, problem.K
    if isinstance(problem, SOCLCP):
        Mx, slack, y, gap = problem.M @ x, x, problem.M @ x + problem.q, 0.0
        straight = float(np.abs(problem.q * x).sum())
    else:
        Mx, slack, y = problem.Q @ x, problem.A @ x + problem.b, point.y
        gap = float(np.abs(x * (Mx + problem.p - problem.A.T @ y)).sum())
        straight = abs(0.5 * float(x @ Mx) + float(problem.p @ x))
    size, leads = K.size.astype(int), np.diff(K.blocks, prepend=-1) != 0
    kind = np.repeat(K.kind, size)
    radii = np.where(leads & np.isin(kind, (Cone.CYLINDER, Cone.BALL)), np.repeat(K.mu, size), 0.0)
    reach = np.sqrt(np.bincount(K.blocks, np.where(leads & (kind == Cone.CYLINDER), 0.0, y) ** 2))
    gap += float(np.abs(np.bincount(K.blocks, slack * y) + np.bincount(K.blocks, radii) * reach).sum())
    return gap / max(gap, straight, 0.5 * abs(float(x @ Mx))) if gap > 0.0 else 0.0


def conic_form(problem: ConeQP | SOCLCP, tolerance: float) -> ConicForm:
    """Scale `problem` to units of its own; errors are judged for `tolerance` (`judged`)."""
    error = judged(problem, tolerance)
    return _program(problem, error) if isinstance(problem, ConeQP) else _complementarity(problem, error)


def _program(problem: ConeQP, error: Callable[[Any], float]) -> ConicForm:
    n, K = problem.p.size, problem.K
    A = problem.A
    whole = matrices.block([[problem.Q, matrices.transpose(A)], [A, matrices.zeros(K.rows, K.rows, problem.Q)]])
    units = equilibrate(whole, np.concatenate([np.arange(n), n + K.blocks]))
    D, E = units[:n], units[n:]
    p, b = D * problem.p, E * problem.b
    Q = congruent(problem.Q, D)
    size = least(max_abs(p) / (max_abs(Q) or 1.0), max_abs(b)) or 1.0
    forces = max(max_abs(p), size * max_abs(Q)) or 1.0
    rows = sp.csr_array(sp.diags_array(E) @ A @ sp.diags_array(D)) if sp.issparse(A) else A * E[:, None] * D
    plain = problem.plain

    def answer(x: Vector, s: Vector, y: Vector) -> ConeQPPoint:
        if plain:  # s is x itself, and in the cone
            inside = size * s / E
            return ConeQPPoint(x=inside, y=problem.Q @ inside + problem.p)
        return ConeQPPoint(x=size * D * x, y=forces * E * y)

    def start(point: ConeQPPoint) -> tuple[Vector, Vector]:
        return point.x / (size * D), point.y / (forces * E)

    scaled = K.in_units(E / size)
    return ConicForm(problem, Q * (size / forces), p / forces, rows, b / size, scaled, answer, start, error)


def _complementarity(problem: SOCLCP, error: Callable[[Any], float]) -> ConicForm:
    K = problem.K
    D = equilibrate(problem.M, K.blocks)
    # where K is {0} a large force must not set a scale
    weighed = D * np.where(K.extended, problem.q, 0.0)
    size = max_abs(weighed) or 1.0
    unit = size * D

    def start(point: SOCLCPPoint) -> tuple[Vector, Vector]:
        return point.x / unit, D * (problem.M @ point.x + problem.q) / size

    return ConicForm(
        problem=problem,
        M=congruent(problem.M, D),
        p=weighed / size,
        A=matrices.identity(weighed.size, problem.M),
        b=np.zeros(weighed.size),
        K=K,
        answer=lambda x, s, y: SOCLCPPoint(x=unit * s),
        start=start,
        error=error,
    )
