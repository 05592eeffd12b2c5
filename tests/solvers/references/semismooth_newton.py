"""Semismooth Newton on the equation of Fischer and Burmeister for lb ≤ z ≤ ub and F(z).

De Luca, Facchinei and Kanzow 1996, Math. Program. 75:407, with Billups' composition (1995) for two bounds and the
nonmonotone line search of Grippo, Lampariello and Lucidi (1986). Raises where the Newton direction does not descend.
"""

from collections.abc import Callable, Iterator

import numpy as np

MEMORY, ARMIJO, ENOUGH = 5, 1e-4, 0.9
Map = Callable[[np.ndarray], np.ndarray]


def semismooth_newton(F: Map, jacobian: Map, lb: np.ndarray, ub: np.ndarray, z: np.ndarray) -> Iterator[np.ndarray]:
    """Yield z, shape (n,), from the start on. Raises RuntimeError where no step descends."""
    z = np.clip(z, lb, ub)
    recent = [merit(z, F(z), lb, ub)]
    while True:
        yield z
        phi, alpha, beta = equation(z, F(z), lb, ub)
        V = np.diag(alpha) + np.diag(beta) @ jacobian(z)  # Step 1: V_k ∈ ∂_C Φ(z_k)
        d = np.linalg.solve(V, -phi)  # Step 2
        slope = (V.T @ phi) @ d
        for k in range(40):  # Step 3, within the bounds
            trial = np.clip(z + 0.5**k * d, lb, ub)
            now = merit(trial, F(trial), lb, ub)
            full = k == 0 and now <= ENOUGH * recent[-1]
            if full or now <= max(recent) + ARMIJO * 0.5**k * slope:
                break
        else:
            raise RuntimeError("the Newton direction does not descend")
        z = trial
        recent = [*recent, now][-MEMORY:]


def fischer(a: float, b: float) -> tuple[float, float, float]:
    """Return a + b − √(a² + b²) and its derivatives; at 0 those along (1, 1)."""
    root = np.hypot(a, b)
    if root == 0.0:
        return 0.0, 1 - np.sqrt(0.5), 1 - np.sqrt(0.5)
    return a + b - root, 1 - a / root, 1 - b / root


def equation(z, F, lb, ub):
    """Return Φ, and α and β with dΦ = α dz + β dF: ψ(z − lb, F), −ψ(ub − z, −F), or ψ(z − lb, −ψ(ub − z, −F))."""
    phi, alpha, beta = F.copy(), np.zeros(z.size), np.ones(z.size)
    for i in range(z.size):
        if ub[i] < np.inf:
            value, by_z, by_F = fischer(ub[i] - z[i], -F[i])
            phi[i], alpha[i], beta[i] = -value, by_z, by_F
        if lb[i] > -np.inf:
            phi[i], by_z, by_inner = fischer(z[i] - lb[i], phi[i])
            alpha[i], beta[i] = by_z + by_inner * alpha[i], by_inner * beta[i]
    return phi, alpha, beta


def merit(z, F, lb, ub):
    return 0.5 * np.sum(equation(z, F, lb, ub)[0] ** 2)
