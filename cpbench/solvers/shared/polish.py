"""The last digits of a cone program, by a few Newton steps from an interior-point answer.

An interior method works with a nearly singular system at the end: on cones it stops at errors of 1e-8 or so. From
there Newton's method on the optimality conditions

    (Qx + p − Aᵀy)/f = 0,   (s − P_K(s − ρy))/σ = 0,   s = Ax + b,  ρ = σ/η,

converges in a few steps. σ of every factor, η = f over its size in A, and the forces f are the scales of the judged
`unit_free`. With J ∈ ∂P_K(s − ρy) and steps (χ dx, η dy) its matrix is

    [ χQ/f            −Aᵀη/f ]
    [ χ(I − J)A/σ      J     ].
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.foundation.factorization import sparse_lu
from cpbench.foundation.matrices import max_abs
from cpbench.solvers.shared.jacobians import projection_jacobian

SHIFTS = (1e-13, 1e-10, 1e-7)
"""Added to the diagonal, the next one where a step does not help: multipliers that are not unique make the matrix
singular."""
GAIN = 0.5
"""A step that leaves more than this share of the error does not help."""


def polish(
    problem: ConeQP,
    point: ConeQPPoint,
    tolerance: float,
    steps: int,
    measure: Callable[[ConeQPPoint], float] | None = None,
) -> tuple[ConeQPPoint, float, int]:
    """Return the best answer of at most `steps` Newton steps, its error and how many were done. measure : of the
    error, by norms where it is None."""

    def by_norms(point: ConeQPPoint) -> float:
        return problem.residuals(point, tolerance).error

    measure = measure or by_norms
    best, error = point, measure(point)
    done, at = 0, 0
    while error > tolerance and done < steps and at < len(SHIFTS):
        candidate = _step(problem, best, SHIFTS[at])
        reached = measure(candidate) if candidate is not None else math.inf
        if not reached <= GAIN * error:
            at += 1
        if candidate is not None and reached < error:
            best, error = candidate, reached
        done += 1
    return best, error, done


def _step(problem: ConeQP, point: ConeQPPoint, shift: float) -> ConeQPPoint | None:
    """Take one Newton step; None where the matrix is singular."""
    x, y, K, n = point.x, point.y, problem.K, problem.p.size
    unit = max(max_abs(x), problem.x_unit) or 1.0
    Qx = problem.Q @ x
    forces = max(max_abs(problem.p), max_abs(Qx), max_abs(problem.Q) * problem.x_unit) or 1.0
    sigma, eta = np.maximum(problem.block_data, unit) * problem.block_sizes, forces / problem.block_sizes
    s = problem.A @ x + problem.b
    shifted = s - (sigma / eta) * y
    J = projection_jacobian(K, shifted)
    A = sp.csr_array(problem.A)
    lower = (A - J @ A).multiply((unit / sigma)[:, None])
    blocks: list[list[Any]] = [
        [sp.csr_array(problem.Q) * (unit / forces), (-A.T).multiply(eta / forces)],
        [lower, J],
    ]
    H = sp.csc_array(sp.block_array(blocks))
    lu = sparse_lu(H + shift * sp.eye_array(H.shape[0], format="csc"))
    if lu is None:
        return None
    residual = np.concatenate([(Qx + problem.p - problem.A.T @ y) / forces, (s - K.project(shifted)) / sigma])
    step = lu.solve(-residual)
    following = ConeQPPoint(x=x + unit * step[:n], y=y + eta * step[n:])
    return following if following.finite else None
