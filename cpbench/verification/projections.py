"""The judge's own projections on the factors of a product of cones, row by row.

Nothing here is shared with what solves: a wrong projection there must not hide behind the same one here.
"""

from __future__ import annotations

import numpy as np

from cpbench.foundation.cones import Cone
from cpbench.foundation.matrices import Dense, Vector


def project(kind: Cone, y: Dense, mu: Vector, mu_r: Vector) -> Dense:
    """Project every row of y on its factor (Euclidean), shape (count, size)."""
    match kind:
        case Cone.SECOND_ORDER:
            return _second_order(y, mu)
        case Cone.ROLLING:
            return _rolling(y, mu, mu_r)
        case Cone.ROLLING_DUAL:  # Moreau: P_K*(y) = y + P_K(−y)
            return y + _rolling(-y, mu, mu_r)
        case Cone.CYLINDER:
            return np.column_stack([np.maximum(y[:, 0], 0.0), _cut(y[:, 1:], mu)])
        case Cone.BALL:
            return _cut(y, mu)
        case _:
            raise ValueError(f"{kind.name} is a box")


def _second_order(y: Dense, mu: Vector) -> Dense:
    """Project on {‖y_T‖ ≤ μ y_N}: the better of y itself, 0, and the foot on the ray through y_T; μ = ∞ is y_N ≥ 0."""
    n, t = y[:, 0], row_norms(y[:, 1:])
    half_space = np.isinf(mu)
    slope = np.where(half_space, 0.0, mu) if half_space.any() else mu
    # the ray (cos a, sin a) with tan a = μ; its foot is the part of (n, t) along it
    cos = 1.0 / np.sqrt(1.0 + slope * slope)
    along = np.maximum((n + slope * t) * cos, 0.0)
    inside = (t <= slope * n) & (n >= 0)
    new_n = np.where(inside, n, along * cos)
    new_t = np.where(inside, t, along * slope * cos)
    if half_space.any():
        new_n, new_t = np.where(half_space, np.maximum(n, 0.0), new_n), np.where(half_space, t, new_t)
    return np.column_stack([new_n, y[:, 1:] * _ratio(new_t, t)[:, None]])


def _rolling(y: Dense, mu: Vector, mu_r: Vector) -> Dense:
    """Project on {‖y_T‖ ≤ μ y_N, ‖y_M‖ ≤ μ_r y_N}: the largest of the feet r with each choice of active parts, and of
    0.

    The derivative r − n − μ(t − μr)₊ − μ_r(m − μ_r r)₊ of half the squared distance is the least of the rising lines
    of the choices, so its root is the largest of theirs. Squared distances differ by too little to choose by.
    """
    k = (y.shape[1] - 1) // 2
    n, t, m = y[:, 0], row_norms(y[:, 1 : 1 + k]), row_norms(y[:, 1 + k :])
    best = np.zeros(len(y))
    for a in (0.0, 1.0):
        for b in (0.0, 1.0):
            best = np.maximum(best, (n + a * mu * t + b * mu_r * m) / (1.0 + a * mu**2 + b * mu_r**2))
    return np.column_stack([best, _cut(y[:, 1 : 1 + k], mu * best), _cut(y[:, 1 + k :], mu_r * best)])


def _cut(y: Dense, length: Vector) -> Dense:
    """Return every row, no longer than its length."""
    size = row_norms(y)
    return y * _ratio(np.minimum(size, length), size)[:, None]


def row_norms(y: Dense) -> Vector:
    """Return the Euclidean norm of every row."""
    return np.sqrt(np.einsum("ij,ij->i", y, y))


def _ratio(a: Vector, b: Vector) -> Vector:
    """Return a/b, 0 where b = 0."""
    return np.divide(a, b, out=np.zeros(a.shape), where=b > 0)
