"""Lemke's method on a small LCP with the error of its answer, in one call."""

import numpy as np
from numba import float64, int64, njit, types

from cpbench.solvers.kernels.array_types import DATA
from cpbench.solvers.kernels.pivoting import lemke
from cpbench.solvers.kernels.splitting import judged

MATRIX = float64[:, ::1]


@njit(
    types.Tuple((int64, float64))(MATRIX, DATA, float64[::1], float64, int64, float64, float64),
    cache=True,
    nogil=True,
)
def lemke_judged(M, q, z, z_unit, max_pivots, pivot_tolerance, tie_tolerance):
    """Return (what `lemke` returns, the judged error of z, NaN where it is not finite); z_unit : of the LCP."""
    n = q.size
    w = np.empty(n)
    code = lemke(M, q.copy(), z, max_pivots, pivot_tolerance, tie_tolerance)
    for i in range(n):
        total = q[i]
        for j in range(n):
            total += M[i, j] * z[j]
        w[i] = total
    return code, judged(q, z, w, z_unit)


@njit(float64(MATRIX), cache=True, nogil=True)
def spread(M):
    """Return by how much the largest entries of the rows differ, or those of the columns; those without any do not
    count."""
    n = M.shape[0]
    column = np.zeros(n)
    low, high = np.inf, 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            size = abs(M[i, j])
            row = max(row, size)
            column[j] = max(column[j], size)
        if row > 0.0:
            low, high = min(low, row), max(high, row)
    found = high / low
    low, high = np.inf, 0.0
    for j in range(n):
        if column[j] > 0.0:
            low, high = min(low, column[j]), max(high, column[j])
    return max(found, high / low)


READY = True
