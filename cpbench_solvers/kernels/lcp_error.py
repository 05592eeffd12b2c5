"""The error of an LCP's answer by norms."""

import numpy as np

from cpbench.foundation.kernels import DATA, DATA_2D, float64, kernel
from cpbench_solvers.kernels.row_errors import FAST, INDICES


@kernel(float64(DATA, DATA, DATA, float64), fast=FAST)
def judged(q, z, w, z_unit):
    """Return max(natural, unit_free) of `cpbench.formulations.linear` for Mz = w - q; NaN when anything is."""
    n = q.size
    natural = 0.0
    q_square = 0.0
    z_top = z_unit
    w_top = 0.0
    for i in range(n):
        least = z[i] if z[i] < w[i] else w[i]
        natural += least * least
        q_square += q[i] * q[i]
        z_top = max(z_top, abs(z[i]))
        w_top = max(w_top, max(abs(q[i]), abs(w[i] - q[i])))
    z_scale = 1.0 / z_top if z_top > 0.0 else 1.0
    w_scale = 1.0 / w_top if w_top > 0.0 else 1.0
    unit_free = 0.0
    for i in range(n):
        a = z[i] * z_scale
        b = w[i] * w_scale
        least = a if a < b else b
        unit_free += least * least
    natural = np.sqrt(natural)
    if q_square > 0.0:
        natural /= np.sqrt(q_square)
    unit_free = np.sqrt(unit_free)
    return natural if not natural < unit_free else unit_free  # so: a NaN is returned


@kernel(float64(DATA_2D, DATA, DATA, float64), fast=FAST)
def error_dense(M, q, z, z_unit):
    """Return `judged` of an answer. M : (n, n). q, z : (n,). z_unit : of the LCP."""
    w = np.empty(q.size)
    for i in range(q.size):
        row, total = M[i], q[i]
        for j in range(row.size):
            total += row[j] * z[j]
        w[i] = total
    return judged(q, z, w, z_unit)


@kernel(*(float64(*index, DATA, DATA, DATA, float64) for index in INDICES), fast=FAST)
def error_sparse(start, columns, values, q, z, z_unit):
    """Measure as `error_dense` does; row i of M has values[start[i]:start[i+1]] in columns[start[i]:start[i+1]]."""
    w = np.empty(q.size)
    for i in range(q.size):
        total = q[i]
        for e in range(start[i], start[i + 1]):
            total += values[e] * z[columns[e]]
        w[i] = total
    return judged(q, z, w, z_unit)
