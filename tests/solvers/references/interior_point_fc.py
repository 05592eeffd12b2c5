"""Interior points on frictional contact in the Jordan algebra of the Lorentz cone, with matrices for its operators.

Wy + q + φ(w) e_N − w = 0, y ∘ w = σ e, φ(w) = √(‖w_T‖² + ε²), y and w inside (Acary, Armand, Nguyen and Shpakovych
2024), scaled as by Nesterov and Todd (1998), with Mehrotra's corrector (1992).
"""

import numpy as np
from scipy.linalg import block_diag


def interior_point_fc(W, q, mu, d, boundary=0.7, smoothing=0.1):
    """Yield r, shape (nc·d,), after every step; μ > 0."""
    nc = mu.size
    s = np.repeat(np.sqrt(d / np.diag(W).reshape(nc, d).sum(axis=1)), d)
    unit = s * np.repeat(mu, d) ** (np.arange(nc * d) % d > 0)  # of r_T/μ: the cones are Lorentz's
    W, q, size = unit[:, None] * W * unit, unit * q, np.abs(unit * q).max()
    e = np.tile(np.eye(d)[0], nc)
    y, w = size * e, size * e
    while True:
        gap, rows = y @ w / nc, list(zip(y.reshape(nc, d), w.reshape(nc, d), strict=True))
        phi = [np.hypot(np.linalg.norm(b[1:]), smoothing * gap / size) for _, b in rows]
        slope = block_diag(*[np.outer(np.eye(d)[0], [0, *b[1:] / p]) for (_, b), p in zip(rows, phi, strict=True)])
        residual = W @ y + q + np.repeat(phi, d) * e - w
        # Nesterov and Todd: P(g) y = w for g = P(y^-½)(P(y^½) w)^½
        g = [quad(power(a, -0.5)) @ power(quad(power(a, 0.5)) @ b, 0.5) for a, b in rows]
        theta, root = (block_diag(*[quad(power(a, p)) for a in g]) for p in (1.0, 0.5))
        newton = np.block([[W, slope - np.eye(nc * d)], [theta, np.eye(nc * d)]])
        dy, dw = np.split(np.linalg.solve(newton, np.r_[-residual, -w]), 2)  # predictor
        t = min(1.0, longest(y, dy, d), longest(w, dw, d))
        sigma = np.clip((y + t * dy) @ (w + t * dw) / (nc * gap), 0, 1) ** 3
        wanted = sigma * gap * e - arrow(root @ dy, d) @ np.linalg.solve(root, dw)  # less the second order
        right = root @ (np.linalg.solve(arrow(root @ y, d), wanted) - root @ y)
        dy, dw = np.split(np.linalg.solve(newton, np.r_[-residual, right]), 2)  # corrector
        t = min(1.0, boundary * min(longest(y, dy, d), longest(w, dw, d)))
        y, w = y + t * dy, w + t * dw
        yield unit * y


def power(x: np.ndarray, p: float) -> np.ndarray:
    """Return λ₁ᵖc₁ + λ₂ᵖc₂, λ = x_N ∓ ‖x_T‖."""
    t = np.linalg.norm(x[1:])
    low, high = (x[0] - t) ** p / 2, (x[0] + t) ** p / 2
    return np.r_[low + high, (high - low) * (x[1:] / t if t > 0 else x[1:])]


def quad(x: np.ndarray) -> np.ndarray:
    """Return the matrix of P(x) = 2xxᵀ − det(x) J."""
    return 2 * np.outer(x, x) - (x[0] ** 2 - x[1:] @ x[1:]) * np.diag([1.0, *[-1.0] * (x.size - 1)])


def arrow(x: np.ndarray, d: int) -> np.ndarray:
    """Return the matrix of a ↦ x ∘ a = (xᵀa, x_N a_T + a_N x_T), block by block."""
    return block_diag(*[np.vstack([a, np.c_[a[1:], a[0] * np.eye(d - 1)]]) for a in x.reshape(-1, d)])


def longest(x: np.ndarray, dx: np.ndarray, d: int) -> float:
    """Return the largest t with x + t dx in the cones: −1 over the least eigenvalue of P(x^-½) dx."""
    changes = [quad(power(a, -0.5)) @ b for a, b in zip(x.reshape(-1, d), dx.reshape(-1, d), strict=True)]
    fastest = max(np.linalg.norm(change[1:]) - change[0] for change in changes)
    return 1 / fastest if fastest > 0 else np.inf
