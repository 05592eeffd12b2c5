"""Cone programs and cone complementarity problems as one, scaled: Mx + p = Aᵀy, s = Ax + b ∈ K, −y ∈ N_K(s).

With x = u D x̂ and s = u E⁻¹ ŝ, E constant on every factor, the entries of D M D and E A D are about 1, and so are x̂
and ŷ where the problem has one size. A complementarity problem has A = I.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.coneqp import ConeQP, ConeQPPoint
from cpbench.formulations.sizes import least
from cpbench.formulations.soclcp import SOCLCP, SOCLCPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector, max_abs
from cpbench.foundation.product_cones import ProductCone
from cpbench.verification.verdict import error_of
from cpbench_solvers.nonlinear.natural_map import congruent, equilibrate


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
    """Return what measures an answer: by norms (`residuals`) and, where these are within the tolerance, as the verdict
    does."""

    def error(point: Any) -> float:
        found = problem.residuals(point, tolerance).error if point.finite else np.inf
        return max(found, error_of(problem, point).error) if found <= tolerance else found

    return error


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
    felt = D * np.where(K.extended, problem.q, 0.0)
    size = max_abs(felt) or 1.0
    unit = size * D

    def start(point: SOCLCPPoint) -> tuple[Vector, Vector]:
        return point.x / unit, D * (problem.M @ point.x + problem.q) / size

    return ConicForm(
        problem=problem,
        M=congruent(problem.M, D),
        p=felt / size,
        A=matrices.identity(felt.size, problem.M),
        b=np.zeros(felt.size),
        K=K,
        answer=lambda x, s, y: SOCLCPPoint(x=unit * s),
        start=start,
        error=error,
    )
