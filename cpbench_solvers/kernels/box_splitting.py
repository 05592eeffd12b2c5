"""Gauss–Seidel sweeps with projection on bounds, M by rows (CSR)."""

import numpy as np

from cpbench.foundation.kernels import DATA, INDEX, boolean, float64, int64, kernel, tuple_of


@kernel(tuple_of(int64, boolean)(INDEX, INDEX, DATA, DATA, DATA, DATA, DATA, float64[::1], float64, float64, int64))
def sweeps(start, column, value, diagonal, q, lower, upper, z, omega, threshold, most):
    """Return z_i ← clip(z_i − ω w_i/M_ii) in place, one after the other; (sweeps done, whether `threshold` ended them).

    Parameters
    ----------
    start, column, value : rows of M. diagonal, q, lower, upper, z : (n,). omega : relaxation.
    threshold : a sweep with ‖Δz·M_ii‖∞ at most that, or not finite, is the last; `most` : the most sweeps.
    """
    for sweep in range(most):
        largest = 0.0
        for i in range(q.size):
            w = q[i]
            for k in range(start[i], start[i + 1]):
                w += value[k] * z[column[k]]
            old = z[i]
            new = min(max(old - omega * w / diagonal[i], lower[i]), upper[i])
            z[i] = new
            largest = max(largest, abs(new - old) * diagonal[i])
        if largest <= threshold or not np.isfinite(largest):
            return sweep + 1, True
    return most, False
