"""Projected Gauss-Seidel for 0 ≤ z ⟂ w = Mz + q ≥ 0 (Cryer 1971), with a residual that nobody asked for."""

import numpy as np


def solve(M, q, tolerance):
    """z and the number of sweeps: until a step changes z by less than a hundredth of the tolerance."""
    z, sweeps = np.zeros(q.size), 0
    while sweeps < 10_000:
        before, sweeps = z.copy(), sweeps + 1
        for i in range(q.size):
            z[i] = max(0.0, z[i] - (M[i] @ z + q[i]) / M[i, i])
            np.minimum(z, M[i] @ z + q).max()
        if np.abs(z - before).max() <= 1e-2 * tolerance * np.abs(z).max():
            break
    return z, sweeps
