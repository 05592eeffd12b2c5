"""Lagrangian (2) of a QP and its dual function (5)-(8), for Q nonsingular."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench import QP
from cpbench.foundation.matrices import Dense, Vector, dense


def lagrangian(qp: QP, z: Vector, lam: Vector, mu: Vector) -> float:
    """½zᵀQz + pᵀz − λᵀ(Az − b) − μᵀ(Cz − d), equation (2); the QP has no bounds beside its rows."""
    return float(qp.objective(z) - lam @ (qp.A @ z - qp.b) - mu @ (qp.C @ z - qp.d))


@dataclass(frozen=True, eq=False)
class DualValue:
    """θ(λ, μ) twice: the Lagrangian at its minimiser (7), and in closed form (8)."""

    minimiser: Vector
    at_minimiser: float
    closed: float


def dual_function(qp: QP, lam: Vector, mu: Vector) -> DualValue:
    """θ at one pair of multipliers.

    >>> from lecture.numerics.examples.linear import quadratic
    >>> value = dual_function(quadratic(), np.array([1.0, 0.5]), np.array([-0.3]))
    >>> abs(value.at_minimiser - value.closed) < 1e-12
    True
    """
    pull = qp.A.T @ lam + qp.C.T @ mu - qp.p
    z = np.linalg.solve(dense(qp.Q), pull)
    return DualValue(z, lagrangian(qp, z, lam, mu), float(-0.5 * pull @ z + qp.b @ lam + qp.d @ mu))


def dual_along(qp: QP, lam: Vector, mu: Vector, row: int, values: Vector) -> Vector:
    """θ while one multiplier λ_row takes `values` and the others stay."""
    found = np.empty(values.size)
    for k, value in enumerate(values):
        moved = np.array(lam)
        moved[row] = value
        found[k] = dual_function(qp, moved, mu).closed
    return found


def objective_over(qp: QP, x: Dense, y: Dense) -> Dense:
    """The objective of a QP of two unknowns over a grid."""
    Q, p = dense(qp.Q), qp.p
    return 0.5 * (Q[0, 0] * x * x + 2 * Q[0, 1] * x * y + Q[1, 1] * y * y) + p[0] * x + p[1] * y
