"""The judged error of an MLCP in scaled data: rows K x + k in units of `row_unit`, x in units of `unit`."""

import numpy as np

from cpbench.foundation.kernels import DATA, DATA_2D, float64, int64, kernel


@kernel(float64(DATA, int64, DATA, DATA, DATA, DATA, DATA, float64, float64))
def judged(k, n, row_unit, unit, x, of_u, of_v, v_unit, push):
    """Return max(natural, unit_free, equality) of `cpbench.formulations.linear`; not finite when anything is.

    Parameters
    ----------
    n : equalities. of_u, of_v : (N,), K x of the free unknowns and of the others. v_unit : of the problem.
    push : max|C| v_unit, the scale of the equalities where a = 0.
    """
    equality = a_square = Au_square = Cv_square = 0.0
    for i in range(n):
        Au, Cv, a = of_u[i] * row_unit[i], of_v[i] * row_unit[i], k[i] * row_unit[i]
        row = Au + Cv + a
        equality += row * row
        a_square += a * a
        Au_square += Au * Au
        Cv_square += Cv * Cv
    natural, b_square = equality, 0.0
    v_top, w_top = v_unit, 0.0
    for i in range(n, k.size):
        v, Du, Bv, b = unit[i] * x[i], of_u[i] * row_unit[i], of_v[i] * row_unit[i], k[i] * row_unit[i]
        w = Du + Bv + b
        least = v if v < w else w
        natural += least * least
        b_square += b * b
        v_top = max(v_top, abs(v))
        w_top = max(w_top, max(abs(b), max(abs(Du), abs(Bv))))
    natural = np.sqrt(natural)
    data = np.sqrt(a_square + b_square)
    if data == 0.0 or not np.isfinite(natural):  # without data only absolute numbers make sense
        return natural
    v_scale = 1.0 / v_top if v_top > 0.0 else 1.0
    w_scale = 1.0 / w_top if w_top > 0.0 else 1.0
    unit_free = 0.0
    for i in range(n, k.size):
        v = unit[i] * x[i] * v_scale
        w = (of_u[i] + of_v[i] + k[i]) * row_unit[i] * w_scale
        least = v if v < w else w
        unit_free += least * least
    scale = np.sqrt(a_square) if a_square > 0.0 else push  # equalities without constants have their size from C alone
    scale = max(scale, np.sqrt(max(Au_square, Cv_square)))
    equality = np.sqrt(equality)
    if scale > 0.0:
        equality /= scale
    return max(natural / data, max(np.sqrt(unit_free), equality))


@kernel(float64(DATA_2D, DATA, int64, DATA, DATA, float64, float64, DATA, float64[::1], float64[::1]))
def error_with(K, k, n, row_unit, unit, v_unit, push, x, of_u, of_v):
    """Return the judged error of unit * x. K : (N, N). of_u, of_v : (N,), workspace."""
    N = k.size
    for i in range(N):
        first = second = 0.0
        for j in range(n):
            first += K[i, j] * x[j]
        for j in range(n, N):
            second += K[i, j] * x[j]
        of_u[i], of_v[i] = first, second
    return judged(k, n, row_unit, unit, x, of_u, of_v, v_unit, push)
