"""What an iteration of ADMM on frictional contact does besides its linear solve: relaxation, cones, duals, shift.

Reference in plain NumPy: `tests/solvers/references/admm_fc.py`.
"""

import numpy as np

from cpbench.foundation.kernels import DATA, FAST, VECTOR, float64, int64, kernel, void


@kernel(void(DATA, DATA, float64, float64, int64, VECTOR, VECTOR, VECTOR, VECTOR), fast=FAST)
def advance(x, mu, rho, alpha, d, z, xi, shift, sizes):
    """Set z ← P_K(x̃ + ξ) with x̃ = αx + (1 − α)z, ξ ← ξ + x̃ − z, shift ← μ‖u_T‖ with u_T = −ρξ_T; all in place.

    Parameters
    ----------
    x, z, xi : (nc·d,). shift : (nc,). sizes : (4,) becomes the squares of ‖x − z‖, ‖z − z_old‖, ‖x‖, ‖ξ‖.
    """
    sizes[:] = 0.0  # sums over all contacts, in the same pass: the penalty is balanced by them
    for i in range(mu.size):
        first = d * i
        normal = alpha * x[first] + (1.0 - alpha) * z[first] + xi[first]
        square = 0.0
        for k in range(first + 1, first + d):
            t = alpha * x[k] + (1.0 - alpha) * z[k] + xi[k]
            square += t * t
        length = np.sqrt(square)
        factor, kept = 1.0, normal
        if normal < 0.0 or length > mu[i] * normal:
            kept = (normal + mu[i] * length) / (1.0 + mu[i] * mu[i])
            factor = mu[i] * kept / length
            if kept <= 0.0:
                factor = kept = 0.0
        slip = 0.0
        for k in range(first, first + d):
            y = alpha * x[k] + (1.0 - alpha) * z[k] + xi[k]
            new = kept if k == first else factor * y
            sizes[0] += (x[k] - new) ** 2
            sizes[1] += (new - z[k]) ** 2
            sizes[2] += x[k] * x[k]
            z[k] = new
            xi[k] = y - new  # scaled dual: u = −ρξ, so that no division by ρ is needed here
            sizes[3] += xi[k] * xi[k]
            if k > first:
                slip += xi[k] * xi[k]
        shift[i] = mu[i] * rho * np.sqrt(slip)  # of the dual iterate: it is in K*, as the limit of Wr + q is
