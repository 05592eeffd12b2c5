"""Projected Gauss–Seidel with over-relaxation on an LCP, forth or forth and back; w = Mz + q is carried along.

A component that stays where it is costs nothing; one that moves costs an axpy with its column of M. Only
reassociation and contraction are allowed to the compiler, so NaN and infinity keep their meaning.

Reference in plain NumPy: `tests/solvers/references/psor.py`.
"""

from numba import boolean, float64, int64, njit

from cpbench_solvers.kernels.array_types import DATA, DATA_2D, INDEX, KEPT, VECTOR
from cpbench_solvers.kernels.lcp_error import FAST, judged
from cpbench_solvers.kernels.vectors import put


@njit(int64(DATA_2D, DATA, DATA, VECTOR, VECTOR, float64, float64, boolean, float64, VECTOR), fastmath=FAST, **KEPT)
def sweeps_dense(columns, diagonal, q, z, w, z_unit, omega, symmetric, tolerance, errors):
    """Make at most `errors.size` sweeps, in place on z and w; returns how many were done.

    Parameters
    ----------
    columns : (n, n), row j is column j of M. symmetric : whether every sweep is followed by one in the other order,
    which counts as the same sweep. errors : the judged error after each sweep.
    """
    n = q.size
    for s in range(errors.size):
        for k in range(2 * n if symmetric else n):
            i = k if k < n else 2 * n - 1 - k
            moved = z[i] - omega * w[i] / diagonal[i]
            new = moved if moved > 0.0 else 0.0
            change = new - z[i]
            if change != 0.0:
                z[i] = new
                for j in range(n):
                    w[j] += columns[i, j] * change
        errors[s] = judged(q, z, w, z_unit)
        if not errors[s] > tolerance:
            return s + 1
    return errors.size


@njit(
    int64(INDEX, INDEX, DATA, DATA, DATA, VECTOR, VECTOR, float64, float64, boolean, float64, VECTOR),
    fastmath=FAST,
    **KEPT,
)
def sweeps_sparse(start, rows, values, diagonal, q, z, w, z_unit, omega, symmetric, tolerance, errors):
    """Sweep as `sweeps_dense` does; column j of M has values[start[j]:start[j+1]] in rows[start[j]:start[j+1]]."""
    n = q.size
    for s in range(errors.size):
        for k in range(2 * n if symmetric else n):
            i = k if k < n else 2 * n - 1 - k
            moved = z[i] - omega * w[i] / diagonal[i]
            new = moved if moved > 0.0 else 0.0  # a NaN becomes 0 here and shows in w
            change = new - z[i]
            if change != 0.0:
                z[i] = new
                for e in range(start[i], start[i + 1]):
                    w[rows[e]] += values[e] * change
        errors[s] = judged(q, z, w, z_unit)
        if not errors[s] > tolerance:
            return s + 1
    return errors.size


@njit(float64(DATA_2D, DATA, DATA, float64, VECTOR), fastmath=FAST, **KEPT)
def afresh_dense(columns, q, z, z_unit, w):
    """Write w = Mz + q without the rounding of sweeps, from the columns that z needs; return the judged error."""
    put(w, q)
    for i in range(q.size):
        if z[i] != 0.0:
            for j in range(q.size):
                w[j] += columns[i, j] * z[i]
    return judged(q, z, w, z_unit)


@njit(float64(INDEX, INDEX, DATA, DATA, DATA, float64, VECTOR), fastmath=FAST, **KEPT)
def afresh_sparse(start, rows, values, q, z, z_unit, w):
    """Compute as `afresh_dense` does."""
    put(w, q)
    for i in range(q.size):
        if z[i] != 0.0:
            for e in range(start[i], start[i + 1]):
                w[rows[e]] += values[e] * z[i]
    return judged(q, z, w, z_unit)
