"""Lemke's method on a small LCP from bases of two unknowns, where it ends in a ray from w = q: all in one call.

The basis of a pair (r, i) makes of (M, q) its principal transform (M', q'), with the same solutions: w' = (z_B, w_N)
and z' = (w_B, z_N) for B = {r, i} (Cottle, Pang and Stone 1992, section 2.3), formed as a whole, in units of z_B and q.
"""

import numpy as np

from cpbench.foundation.kernels import DATA, INDEX, boolean, float64, int64, kernel, tuple_of
from cpbench_solvers.kernels.pivoting import lemke
from cpbench_solvers.kernels.tableau import CODES, COMPLEMENTARY

MATRIX = float64[:, ::1]
CONDITION = 1e-13
"""The least determinant of M_BB, as a share of what cancels in it, that is no rounding error."""
ROUNDING = 1e-13
"""Entries of q' this little below zero, in units of its size, are zero."""


@kernel(int64(MATRIX, int64))
def least_served(M, r):
    """Return the i with the least M_ir > 0 among those with M_ri ≠ 0, -1 without any."""
    found = -1
    for i in range(M.shape[0]):
        # the unknown that z_r helps least is the one that will block first
        if i != r and M[i, r] > 0.0 and M[r, i] != 0.0 and (found < 0 or M[i, r] < M[found, r]):
            found = i
    return found


@kernel(boolean(MATRIX, DATA, int64, int64, MATRIX, float64[::1], float64[::1], float64[::1]))
def transform(M, q, r, i, T, t, row_unit, column_unit):
    """Write M' and q' of the basis {r, i}, rows over row_unit, columns times column_unit; False if singular."""
    n = q.size
    a, b, c, d = M[r, r], M[r, i], M[i, r], M[i, i]
    size, det = abs(a * d) + abs(b * c), a * d - b * c
    if not abs(det) > CONDITION * size:  # else M' would be made of rounding
        return False
    # z_B = M_BB⁻¹ (w_B - M_BN z_N - q_B)
    z_r, z_i = -(d * q[r] - b * q[i]) / det, -(a * q[i] - c * q[r]) / det
    z_size = max(abs(z_r), abs(z_i))
    w_size = 0.0
    for k in range(n):
        w_size = max(w_size, abs(q[k]))
    z_size, w_size = z_size if z_size > 0.0 else 1.0, w_size if w_size > 0.0 else 1.0
    for k in range(n):
        basic = k in (r, i)
        row_unit[k] = z_size if basic else w_size
        column_unit[k] = w_size if basic else z_size
    for j in range(n):  # the rows of z_B, by columns: w_r, w_i, or z_j
        u, v = M[r, j], M[i, j]
        if j == r:
            T[r, j], T[i, j] = d / det, -c / det
        elif j == i:
            T[r, j], T[i, j] = -b / det, a / det
        else:
            T[r, j], T[i, j] = -(d * u - b * v) / det, -(a * v - c * u) / det
    t[r], t[i] = z_r, z_i
    for k in range(n):
        if k not in (r, i):
            g, h = M[k, r], M[k, i]
            for j in range(n):
                own = 0.0 if j in (r, i) else M[k, j]
                T[k, j] = own + g * T[r, j] + h * T[i, j]
            t[k] = q[k] + g * z_r + h * z_i
    for k in range(n):
        t[k] /= row_unit[k]
        if -ROUNDING <= t[k] < 0.0:
            t[k] = 0.0  # a q' that is 0 exactly needs no cover: rounding must not make it enter
        for j in range(n):
            T[k, j] *= column_unit[j] / row_unit[k]
    return True


@kernel(tuple_of(*[int64] * 2)(MATRIX, DATA, float64[::1], INDEX, int64, int64, float64, float64))
def from_pairs(M, q, z, order, first, max_pivots, pivot_tolerance, tie_tolerance):
    """Return (how many of the pairs have been tried, pivots), after the first whose way ends in a complementary basis,
    whose z is written; -1 in place of the first where none does.

    Parameters
    ----------
    order : the r of the pairs. first : of these is begun at. max_pivots : of each.
    """
    n, pivots = q.size, 0
    T, t, y = np.empty((n, n)), np.empty(n), np.empty(n)
    row_unit, column_unit = np.empty(n), np.empty(n)
    for p in range(first, order.size):
        r = order[p]
        i = least_served(M, r)
        if i < 0 or not transform(M, q, r, i, T, t, row_unit, column_unit):
            continue
        code = lemke(T, t.copy(), y, max_pivots, pivot_tolerance, tie_tolerance)
        pivots += code // CODES
        if code % CODES == COMPLEMENTARY:
            for k in range(n):
                if k in (r, i):  # a basic unknown: its row of w' = M'z' + q'
                    total = t[k]
                    for j in range(n):
                        total += T[k, j] * y[j]
                    z[k] = max(total, 0.0) * row_unit[k] if y[k] == 0.0 else 0.0
                else:
                    z[k] = y[k] * column_unit[k]
            return p + 1, pivots
    return -1, pivots
