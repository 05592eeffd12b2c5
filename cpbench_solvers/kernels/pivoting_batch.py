"""Lemke's method on many LCPs of one size."""

import numpy as np

from cpbench.foundation.kernels import DATA_2D, DATA_3D, MATRIX, float64, int64, kernel, void
from cpbench_solvers.kernels.pivoting import SPARE, WHOLE, solve
from cpbench_solvers.kernels.tableau import whole_tableau


@kernel(void(DATA_3D, DATA_2D, MATRIX, int64, float64, float64))
def lemke_batch(M, q, z, max_pivots, pivot_tolerance, tie_tolerance):
    """Run `lemke` on each of M (k, n, n), q (k, n): writes z (k, n), which is right where the run ends in a basis."""
    n = q.shape[1]
    if n <= WHOLE:
        T, reals = np.empty((n, n + 1)), np.empty((4, n + 1))
        numbers = np.empty((4, 2 * n + 1), np.int64)
        for i in range(q.shape[0]):
            whole_tableau(M[i], q[i], z[i], T, reals, numbers, max_pivots, pivot_tolerance, tie_tolerance)
        return
    C, E, reals = np.empty((n + 1, n)), np.empty((n + SPARE, n)), np.empty((2, n))
    numbers = np.empty((7, 2 * n + SPARE), np.int64)
    for i in range(q.shape[0]):
        solve(M[i], q[i], z[i], C, E, reals, numbers, max_pivots, pivot_tolerance, tie_tolerance)
