"""Newton's method on the function of Alart and Curnier (1991, CMAME 92:353): Φ(x) = x − P(x − ϱ(Wx + q)).

With W + τϱ⁻¹ for W and a nonmonotone line search on ‖Φ‖ (Acary, Brémond and Huber 2018, Springer LNACM 92:205).
"""

from collections.abc import Iterator

import numpy as np

MEMORY, ARMIJO, HALVINGS = 4, 1e-4, 8


def newton_alart_curnier(W: np.ndarray, q: np.ndarray, mu: np.ndarray, d: int) -> Iterator[np.ndarray]:
    """Yield r, shape (nc·d,), from 0 on. Raises RuntimeError where no step descends."""
    nc = mu.size
    s = np.repeat(np.sqrt(d / np.diag(W).reshape(nc, d).sum(axis=1)), d)  # every W_cc then has mean diagonal 1
    W, q = s[:, None] * W * s, s * q
    diagonal = np.diag(W).reshape(nc, d)
    mean = np.hstack([diagonal[:, :1], np.repeat(diagonal[:, 1:].mean(axis=1, keepdims=True), d - 1, axis=1)])
    rho, share, x = 1 / mean.ravel(), 1e-2, np.zeros(q.size)

    def phi(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        projected, derivative = project(x - rho * (W @ x + q), mu, d)
        return x - projected, derivative

    recent = [np.linalg.norm(phi(x)[0])]
    while share <= 1e4:
        yield s * x
        value, P = phi(x)
        while share <= 1e4:
            # dΦ = (I − P′) dx + P′ϱW dx
            regular = W + min(share * np.linalg.norm(value), 1.0) * np.diag(1 / rho)
            step = np.linalg.solve(np.eye(q.size) - P + P @ np.diag(rho) @ regular, -value)
            for t in 0.5 ** np.arange(HALVINGS + 1):
                size = np.linalg.norm(phi(x + t * step)[0])
                if size <= (1 - ARMIJO * t) * max(recent[-MEMORY:]):
                    break
            else:
                share *= 100.0
                continue
            x, share = x + t * step, max(share / 10.0, 1e-8) if t == 1.0 else share
            recent.append(size)
            break
    raise RuntimeError("no step descends")


def project(y: np.ndarray, mu: np.ndarray, d: int) -> tuple[np.ndarray, np.ndarray]:
    """Return ((y_N)₊, P_D(y_T)), D the disk of radius μ(y_N)₊, of every contact, and its derivative."""
    point, P = np.zeros(y.size), np.zeros((y.size, y.size))
    for c in np.flatnonzero(y[::d] > 0):  # an open contact has P = 0
        N, T = d * c, slice(d * c + 1, d * c + d)
        radius, length = mu[c] * y[N], np.linalg.norm(y[T])
        point[N], P[N, N] = y[N], 1.0
        if length <= radius:  # stick
            point[T], P[T, T] = y[T], np.eye(d - 1)
        else:  # slip
            e = y[T] / length
            point[T], P[T, N] = radius * e, mu[c] * e
            P[T, T] = radius / length * (np.eye(d - 1) - np.outer(e, e))
    return point, P
