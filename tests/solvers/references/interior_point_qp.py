"""Mehrotra's predictor-corrector (1992, SIAM J. Optim. 2:575) for min ½xᵀHx + gᵀx, Cx − c = t ≥ 0, Ex = f, with
Gondzio's corrector (1996, Comput. Optim. Appl. 6:137) where it makes a short step. Every Newton step solves the whole
system in the changes of x, y, z and t.
"""

from collections.abc import Iterator
from typing import TypeAlias

import numpy as np

TO_BOUNDARY, SHORT, LONG = 0.995, 0.1, 0.5
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
        mu, residual = t @ z / m, np.r_[H @ x + g - E.T @ y - C.T @ z, E @ x - f, C @ x - c - t]

        def direction(products, newton=newton, residual=residual):
            return np.split(np.linalg.solve(newton, -np.r_[residual, products]), [n, n + k, n + k + m])

        _, _, dz, dt = direction(t * z)  # predictor: tz = 0
        alpha = min(1.0, reach(t, dt), reach(z, dz))
        sigma = min(((t + alpha * dt) @ (z + alpha * dz) / m / mu) ** 3, 1.0)
        # corrector: tz = σμ, less the second order of the predictor
        step = direction(t * z + (second := dt * dz) - (aim := sigma * mu))
        if length(z, t, step) < SHORT:  # more central, and without the second order
            aim, second = max(aim, 0.5 * mu), 0.0
            step = direction(t * z - aim)
        alpha = length(z, t, step)
        if alpha < LONG:  # products of a longer step nearer to the aim
            trial = min(1.0, 1.5 * alpha + 0.3)
            after = (t + trial * step[3]) * (z + trial * step[2])
            nearer = np.maximum(np.clip(after, 0.1 * aim, 10.0 * aim) - after, -10.0 * aim)
            other = direction(t * z + second - nearer - aim)
            if length(z, t, other) >= alpha + 0.1 * (trial - alpha):
                step, alpha = other, length(z, t, other)
        x, y, z, t = (value + alpha * change for value, change in zip((x, y, z, t), step, strict=True))


def reach(value: np.ndarray, change: np.ndarray) -> float:
    """Return the largest step that keeps value + step·change ≥ 0."""
    falling = change < 0
    return float(np.min(-value[falling] / change[falling], initial=np.inf))


def length(z, t, step) -> float:
    return min(1.0, TO_BOUNDARY * min(reach(t, step[3]), reach(z, step[2])))
