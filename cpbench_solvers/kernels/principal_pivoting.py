"""Murty's principal pivoting on a whole tableau.

The tableau reads y = const + T x. Pair i has a basic variable y_i and a nonbasic one x_i = 0: w_i and z_i at first, the
other way round where `swapped`. A pivot exchanges the two.
"""

import numpy as np

from cpbench.foundation.kernels import MATRIX, VECTOR, boolean, float64, int64, kernel, void

SOLVED, LIMIT, NOT_IN_CLASS, NOT_FINITE = 0, 1, 2, 3
"""Nothing is negative; as many pivots as allowed; the pair in hand has no positive diagonal entry; not a number."""


@kernel(void(MATRIX, int64, VECTOR))
def exchange(T, r, row):
    """Exchange the two variables of pair r in place; row : (n,) workspace.

    From y_r = T_r x: x_r = (y_r - Σ_{j≠r} T_rj x_j)/T_rr, put into the other rows (Cottle, Pang, Stone, 2.3).
    """
    n = T.shape[0]
    inverse = 1.0 / T[r, r]
    for j in range(n):
        row[j] = -T[r, j] * inverse
    row[r] = inverse
    for i in range(n):
        a = T[i, r]
        if a != 0.0 and i != r:
            T[i, r] = 0.0
            for j in range(n):
                T[i, j] += a * row[j]
    for j in range(n):
        T[r, j] = row[j]


@kernel(int64(MATRIX, VECTOR, boolean[::1], int64[::1], int64, float64, float64))
def murty(T, y, swapped, state, until, pivot_tolerance, zero):
    """Exchange the first pair that is negative, until none is (Murty 1974).

    Parameters
    ----------
    T : (n, n) tableau. y : (n,) values of the basic variables. swapped : (n,) which y are z. state : pivots done, and
    the pair in hand, -1 for none. until : pivots to stop at. pivot_tolerance : entries up to this are zero. zero :
    values above minus this are ≥ 0.
    """
    n = y.size
    row = np.empty(n)
    while True:
        r = -1
        for i in range(n):
            if not np.isfinite(y[i]):
                return NOT_FINITE
            if y[i] < -zero:
                r = i
                break
        state[1] = r
        if r < 0:
            return SOLVED
        if not T[r, r] > pivot_tolerance:  # not positive: M is not a P-matrix, for which alone the least index ends
            return NOT_IN_CLASS
        if state[0] >= until:
            return LIMIT
        step = -y[r] / T[r, r]
        for i in range(n):
            y[i] += T[i, r] * step
        y[r] = step
        exchange(T, r, row)
        swapped[r] = not swapped[r]
        state[0] += 1
