"""The data of `mlcp.claims.scale` for a dense MLCP in one call: small ones would take longer to scale than to solve."""

import math

import numpy as np

from cpbench.foundation.kernels import DATA, DATA_2D, VECTOR, float64, helper, int64, kernel, void


@helper(float64(float64))
def power_of_two(top):
    """Return the power of 2 that brings a positive number into [1/2, 1)."""
    return math.ldexp(1.0, -math.frexp(top)[1])


@kernel(void(DATA_2D, DATA_2D, DATA_2D, DATA_2D, DATA, DATA, int64, float64[:, ::1], VECTOR, VECTOR, VECTOR))
def scaled(A, B, C, D, a, b, passes, K, k, unit, row_unit):
    """Write K and k, scaled, and the units: of the unknowns, and of the rows.

    Parameters
    ----------
    A, B, C, D, a, b : of the MLCP. passes : times that rows and columns are divided by the roots of their largest
    entries. K : (N, N). k, unit, row_unit : (N,).
    """
    n, N = a.size, a.size + b.size
    for i in range(N):
        k[i] = a[i] if i < n else b[i - n]
        for j in range(N):
            if i < n:
                K[i, j] = A[i, j] if j < n else C[i, j - n]
            else:
                K[i, j] = D[i - n, j] if j < n else B[i - n, j - n]
    row, column = np.ones(N), np.ones(N)
    by_row, by_column = np.empty(N), np.empty(N)
    for _ in range(passes):
        by_column[:] = 0.0
        for i in range(N):
            top = 0.0
            for j in range(N):
                size = abs(K[i, j]) * row[i] * column[j]
                top = max(top, size)
                by_column[j] = max(by_column[j], size)
            by_row[i] = top
        for i in range(N):
            by_row[i] = 1.0 / math.sqrt(by_row[i] if by_row[i] > 0.0 else 1.0)
            by_column[i] = 1.0 / math.sqrt(by_column[i] if by_column[i] > 0.0 else 1.0)
            if i >= n:  # one factor for row and column of a pair
                by_row[i] = by_column[i] = math.sqrt(by_row[i] * by_column[i])
            row[i] *= by_row[i]
            column[i] *= by_column[i]
    top = 0.0
    for i in range(N):
        # powers of two: scaling and unscaling lose no digit
        row[i], column[i] = power_of_two(1.0 / row[i]), power_of_two(1.0 / column[i])
        top = max(top, abs(row[i] * k[i]))
    common = power_of_two(top if top > 0.0 else 1.0)
    for i in range(N):
        for j in range(N):
            K[i, j] = K[i, j] * row[i] * column[j]
        k[i] *= common * row[i]
        unit[i] = column[i] / common
        row_unit[i] = 1.0 / (common * row[i])
