"""ADMM on frictional contact (Acary, Bourrier and Viennet 2023, hal-03978387, algorithm 1), its penalty balanced.

The penalty follows the relative residuals (Boyd et al. 2011, 3.4.1; Wohlberg 2017, arXiv:1704.06209).
"""

from collections.abc import Iterator

import numpy as np

TINY = 1e-300


def admm_fc(W: np.ndarray, q: np.ndarray, mu: np.ndarray, d: int, rho: float = 0.1) -> Iterator[np.ndarray]:
    """Yield r, shape (nc·d,), in its cones, from 0 on."""
    nc = mu.size
    s = np.repeat(np.sqrt(d / np.diag(W).reshape(nc, d).sum(axis=1)), d)
    W, q = s[:, None] * W * s, s * q
    normal = np.zeros((nc, d))
    normal[:, 0] = 1.0
    z, xi, shift = np.zeros(q.size), np.zeros(q.size), np.zeros(nc)
    rest, since = 20.0, 0
    while True:
        yield s * z
        # x-step: (W + ρI) x = ρ(z − ξ) − q − μ‖u_T‖ e_N, De Saxcé's shift of the iterate before
        x = np.linalg.solve(W + rho * np.eye(q.size), rho * (z - xi) - q - (shift[:, None] * normal).ravel())
        # z-step: the projection on the cones; ξ-step
        old, z = z, np.concatenate([project(y, m) for y, m in zip((x + xi).reshape(nc, d), mu, strict=True)])
        xi = xi + x - z
        u = -rho * xi.reshape(nc, d)
        shift = mu * np.linalg.norm(u[:, 1:], axis=1)
        since += 1
        if since < rest:
            continue
        primal = np.linalg.norm(x - z) / np.linalg.norm(x)
        dual = np.linalg.norm(z - old) / max(np.linalg.norm(xi), np.linalg.norm(q) / rho)
        factor = np.clip(np.sqrt(max(primal, TINY) / max(dual, TINY)), 1 / 30, 30)
        if max(factor, 1 / factor) >= 3:
            xi, rho, rest, since = xi / factor, rho * factor, 1.5 * rest, 0


def project(y: np.ndarray, mu: float) -> np.ndarray:
    """Return the point of K_μ = {‖y_T‖ ≤ μ y_N} next to y."""
    t = np.linalg.norm(y[1:])
    if t <= mu * y[0]:
        return y
    if mu * t <= -y[0]:
        return np.zeros(y.size)
    edge = np.array([1.0, *(mu * y[1:] / t)])
    return (y @ edge) / (edge @ edge) * edge
