"""Mehrotra's predictor-corrector (1992, SIAM J. Optim. 2:575) for min ½xᵀHx + gᵀx, Cx − c = t ≥ 0, Ex = f.

Every Newton step solves the whole system in the changes of x, y, z and t, with nothing eliminated.
"""

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np

TO_BOUNDARY, SHORT = 0.995, 0.1
Iterate: TypeAlias = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def interior_point_qp(H, g, E, f, C, c, start: Iterate) -> Iterator[Iterate]:
    """Yield x (n,), y of the equations, z and t > 0 of the sides, from the start on."""
    x, y, z, t = start
    n, k, m = g.size, f.size, c.size
    while True:
        yield x, y, z, t
        newton = np.block(
            [
                [H, -E.T, -C.T, np.zeros((n, m))],
                [E, np.zeros((k, k + 2 * m))],
                [C, np.zeros((m, k + m)), -np.eye(m)],
                [np.zeros((m, n + k)), np.diag(t), np.diag(z)],
            ]
        )
        residual = np.r_[H @ x + g - E.T @ y - C.T @ z, E @ x - f, C @ x - c - t]
        mu = t @ z / m

        def direction(products, newton=newton, residual=residual):
            return np.split(np.linalg.solve(newton, -np.r_[residual, products]), [n, n + k, n + k + m])

        # predictor: tz = 0
        _, _, dz, dt = direction(t * z)
        alpha = min(1.0, reach(t, dt), reach(z, dz))
        sigma = min(((t + alpha * dt) @ (z + alpha * dz) / m / mu) ** 3, 1.0)
        # corrector: tz = σμ, less the second order of the predictor
        step = direction(t * z + dt * dz - sigma * mu)
        if length(z, t, step) < SHORT:  # more central, and without the second order
            step = direction(t * z - max(sigma * mu, 0.5 * mu))
        alpha = length(z, t, step)
        x, y, z, t = (value + alpha * change for value, change in zip((x, y, z, t), step, strict=True))


def reach(value: np.ndarray, change: np.ndarray) -> float:
    """Return the largest step that keeps value + step·change ≥ 0."""
    falling = change < 0
    return float(np.min(-value[falling] / change[falling], initial=np.inf))


def length(z, t, step) -> float:
    return min(1.0, TO_BOUNDARY * min(reach(t, step[3]), reach(z, step[2])))
