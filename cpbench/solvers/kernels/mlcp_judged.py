"""The judged error of an MLCP from the four products Au, Cv, Du and Bv."""

import numpy as np
from numba import float64, int64, njit, types

DATA = types.Array(float64, 1, "C", readonly=True)
DATA_2D = types.Array(float64, 2, "C", readonly=True)


@njit(float64(DATA, DATA, DATA, DATA, DATA, DATA, DATA, float64, float64), cache=True, error_model="numpy")
def judged(a, b, v, Au, Cv, Du, Bv, v_unit, push):
    """max(natural, unit_free, equality) of `cpbench.formulations.mlcp`; NaN when anything is.

    Parameters
    ----------
    a, Au, Cv : (n,). b, v, Du, Bv : (m,). v_unit : of the problem. push : max|C| v_unit, the scale where a = 0.
    """
    equality = a_square = Au_square = Cv_square = 0.0
    for i in range(a.size):
        row = Au[i] + Cv[i] + a[i]
        equality += row * row
        a_square += a[i] * a[i]
        Au_square += Au[i] * Au[i]
        Cv_square += Cv[i] * Cv[i]
    natural, b_square = equality, 0.0
    v_top, w_top = v_unit, 0.0
    for i in range(b.size):
        w = Du[i] + Bv[i] + b[i]
        least = v[i] if v[i] < w else w
        natural += least * least
        b_square += b[i] * b[i]
        v_top = max(v_top, abs(v[i]))
        w_top = max(w_top, max(abs(b[i]), max(abs(Du[i]), abs(Bv[i]))))
    natural = np.sqrt(natural)
    data = np.sqrt(a_square + b_square)
    if data == 0.0 or not np.isfinite(natural):
        return natural
    v_scale = 1.0 / v_top if v_top > 0.0 else 1.0
    w_scale = 1.0 / w_top if w_top > 0.0 else 1.0
    unit_free = 0.0
    for i in range(b.size):
        x = v[i] * v_scale
        y = (Du[i] + Bv[i] + b[i]) * w_scale
        least = x if x < y else y
        unit_free += least * least
    scale = np.sqrt(a_square) if a_square > 0.0 else push
    scale = max(scale, np.sqrt(max(Au_square, Cv_square)))
    equality = np.sqrt(equality)
    if scale > 0.0:
        equality /= scale
    return max(natural / data, max(np.sqrt(unit_free), equality))


@njit(float64(DATA_2D, DATA, int64, DATA, DATA, float64, float64, DATA), cache=True, error_model="numpy")
def error_of(K, k, n, row_unit, unit, v_unit, push, x):
    """The judged error of unit * x, K and k being those of the problem, in units of `row_unit` for their rows."""
    N = k.size
    of_u, of_v, right, v = np.empty(N), np.empty(N), np.empty(N), np.empty(N - n)
    for i in range(N):
        first = second = 0.0
        for j in range(n):
            first += K[i, j] * x[j]
        for j in range(n, N):
            second += K[i, j] * x[j]
        of_u[i], of_v[i], right[i] = first * row_unit[i], second * row_unit[i], k[i] * row_unit[i]
    for j in range(n, N):
        v[j - n] = unit[j] * x[j]
    return judged(right[:n], right[n:], v, of_u[:n], of_v[:n], of_u[n:], of_v[n:], v_unit, push)


READY = True
