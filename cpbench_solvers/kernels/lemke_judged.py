"""Lemke's method on a small LCP with the error of its answer, in one call."""

import math

import numpy as np

from cpbench.foundation.kernels import DATA, boolean, float64, int64, kernel, tuple_of, void
from cpbench_solvers.kernels.lcp_error import error_dense
from cpbench_solvers.kernels.pivoting import lemke
from cpbench_solvers.kernels.row_errors import is_exact

MATRIX = float64[:, ::1]


@kernel(tuple_of(int64, float64, boolean)(MATRIX, DATA, float64[::1], float64, int64, float64, float64))
def lemke_judged(M, q, z, z_unit, max_pivots, pivot_tolerance, tie_tolerance):
    """Return (what `lemke` returns, the judged error of z, NaN where it is not finite, whether z is exact to rounding);
    z_unit : of the LCP."""
    w = q.copy()  # the pivots end in it
    code = lemke(M, w, z, max_pivots, pivot_tolerance, tie_tolerance)
    return code, error_dense(M, q, z, z_unit), is_exact(M, q, z, 0)


@kernel(float64(MATRIX))
def spread(M):
    """Return by how much the largest entries of rows, or of columns, differ; rows and columns of zeros do not count."""
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
    found = high / low  # ∞ or NaN for a matrix of zeros: then there are no units to even
    low, high = np.inf, 0.0
    for j in range(n):
        if column[j] > 0.0:
            low, high = min(low, column[j]), max(high, column[j])
    return max(found, high / low)


@kernel(void(MATRIX, int64, float64[::1], float64[::1], MATRIX))
def even(M, passes, rows, unknowns, scaled):
    """Write D₁, D₂ and D₁MD₂: powers of two near to Ruiz' scaling, whose passes take the square root of what is left of
    the differences between the largest entries of rows and of columns."""
    n = M.shape[0]
    by_row, by_column = np.empty(n), np.empty(n)
    rows[:] = 1.0
    unknowns[:] = 1.0
    for _ in range(passes):
        by_row[:] = 0.0
        by_column[:] = 0.0
        for i in range(n):
            for j in range(n):
                size = abs(M[i, j]) * rows[i] * unknowns[j]
                by_row[i] = max(by_row[i], size)
                by_column[j] = max(by_column[j], size)
        for i in range(n):
            if by_row[i] > 0.0:
                rows[i] /= np.sqrt(by_row[i])
            if by_column[i] > 0.0:
                unknowns[i] /= np.sqrt(by_column[i])
    for i in range(n):
        rows[i] = math.ldexp(1.0, round(np.log2(rows[i])))
        unknowns[i] = math.ldexp(1.0, round(np.log2(unknowns[i])))
    for i in range(n):
        for j in range(n):
            scaled[i, j] = M[i, j] * rows[i] * unknowns[j]
