"""Gauss–Seidel with over-relaxation on an MLCP: x_j ← x_j − ω r_j/d_j, projected on x_j ≥ 0 where it is not free.

The rows K x are carried along, those of the free unknowns and those of the others apart, as the judged error has them.
Only reassociation and contraction are allowed to the compiler, so NaN and infinity keep their meaning.
"""

from numba import float64, int64, njit

from cpbench_solvers.kernels.array_types import DATA, DATA_2D, INDEX, KEPT, VECTOR
from cpbench_solvers.kernels.mlcp_judged import judged

FAST = {"reassoc", "contract"}
LAW = (DATA, DATA, int64, DATA, DATA, float64, float64)


@njit(int64(DATA_2D, *LAW, VECTOR, VECTOR, VECTOR, float64, float64, VECTOR), fastmath=FAST, **KEPT)
def sweeps_dense(columns, divisors, k, n, row_unit, unit, v_unit, push, x, of_u, of_v, omega, tolerance, errors):
    """Make at most `errors.size` sweeps, in place on x, of_u and of_v; returns how many were done.

    Parameters
    ----------
    columns : (N, N), row j is column j of K. divisors : (N,) d. The first n of x are free. errors : the judged error
    after each sweep.
    """
    N = k.size
    for s in range(errors.size):
        for i in range(N):
            new = x[i] - omega * (of_u[i] + of_v[i] + k[i]) / divisors[i]
            if i >= n and not new > 0.0:  # also NaN becomes 0: the rows carry it on
                new = 0.0
            change = new - x[i]
            if change != 0.0:
                x[i] = new
                if i < n:
                    for j in range(N):
                        of_u[j] += columns[i, j] * change
                else:
                    for j in range(N):
                        of_v[j] += columns[i, j] * change
        errors[s] = judged(k, n, row_unit, unit, x, of_u, of_v, v_unit, push)
        if not errors[s] > tolerance:
            return s + 1
    return errors.size


@njit(int64(INDEX, INDEX, DATA, *LAW, VECTOR, VECTOR, VECTOR, float64, float64, VECTOR), fastmath=FAST, **KEPT)
def sweeps_sparse(
    start, rows, values, divisors, k, n, row_unit, unit, v_unit, push, x, of_u, of_v, omega, tolerance, errors
):
    """Sweep as `sweeps_dense` does; column j of K has values[start[j]:start[j+1]] in rows[start[j]:start[j+1]]."""
    for s in range(errors.size):
        for i in range(k.size):
            new = x[i] - omega * (of_u[i] + of_v[i] + k[i]) / divisors[i]
            if i >= n and not new > 0.0:
                new = 0.0
            change = new - x[i]
            if change != 0.0:
                x[i] = new
                of = of_u if i < n else of_v  # chosen outside of the loop, which then has no branch
                for p in range(start[i], start[i + 1]):
                    of[rows[p]] += values[p] * change
        errors[s] = judged(k, n, row_unit, unit, x, of_u, of_v, v_unit, push)
        if not errors[s] > tolerance:
            return s + 1
    return errors.size
