"""Projected Gauss–Seidel with over-relaxation on an LCP, forth or forth and back; w = Mz + q is carried along.

A component that stays where it is costs nothing; one that moves costs an axpy with its column of M. Only
reassociation and contraction are allowed to the compiler, so NaN and infinity keep their meaning.

Reference in plain NumPy: `tests/solvers/references/psor.py`.
"""

from cpbench.foundation.kernels import DATA, DATA_2D, INDEX, VECTOR, boolean, float64, helper, int64, kernel, tuple_of
from cpbench_solvers.kernels.lcp_error import FAST, judged
from cpbench_solvers.kernels.vectors import put

COLUMNS = tuple_of(*[DATA_2D] * 1), tuple_of(INDEX, INDEX, DATA)
"""M by columns: dense, (columns,), row j of which is column j; sparse, (start, rows, values), column j having
values[start[j]:start[j+1]] in those rows."""


@helper(fast=FAST)
def add_column(matrix, j, factor, w):
    """Add `factor` times column j to w; which of the two loops it is, is known when it is compiled."""
    if len(matrix) == 1:
        for i in range(w.size):
            w[i] += matrix[0][j, i] * factor
    else:
        for e in range(matrix[0][j], matrix[0][j + 1]):
            w[matrix[1][e]] += matrix[2][e] * factor


@kernel(*(int64(M, DATA, DATA, VECTOR, VECTOR, float64, float64, boolean, float64, VECTOR) for M in COLUMNS), fast=FAST)
def sweeps(matrix, diagonal, q, z, w, z_unit, omega, symmetric, tolerance, errors):
    """Make at most `errors.size` sweeps, in place on z and w; returns how many were done.

    Parameters
    ----------
    matrix : see `COLUMNS`. symmetric : whether every sweep is followed by one in the other order, which counts as the
    same sweep. errors : the judged error after each sweep.
    """
    n = q.size
    for s in range(errors.size):
        for k in range(2 * n if symmetric else n):
            i = k if k < n else 2 * n - 1 - k
            moved = z[i] - omega * w[i] / diagonal[i]
            new = moved if moved > 0.0 else 0.0  # a NaN becomes 0 here and shows in w
            change = new - z[i]
            if change != 0.0:
                z[i] = new
                add_column(matrix, i, change, w)
        errors[s] = judged(q, z, w, z_unit)
        if not errors[s] > tolerance:
            return s + 1
    return errors.size


@kernel(*(float64(M, DATA, DATA, float64, VECTOR) for M in COLUMNS), fast=FAST)
def afresh(matrix, q, z, z_unit, w):
    """Write w = Mz + q without the rounding of sweeps, from the columns that z needs; return the judged error."""
    put(w, q)
    for i in range(q.size):
        if z[i] != 0.0:
            add_column(matrix, i, z[i], w)
    return judged(q, z, w, z_unit)
