"""Gauss–Seidel with over-relaxation on an MLCP: x_j ← x_j − ω r_j/d_j, projected on x_j ≥ 0 where it is not free.

The rows K x are carried along, those of the free unknowns and those of the others apart, as the judged error has them.
"""

from cpbench.foundation.kernels import DATA, VECTOR, float64, int64, kernel
from cpbench_solvers.kernels.mlcp_judged import judged
from cpbench_solvers.kernels.row_errors import FAST
from cpbench_solvers.kernels.splitting import COLUMNS, add_column

LAW = (DATA, DATA, int64, DATA, DATA, float64, float64)


@kernel(*(int64(M, *LAW, VECTOR, VECTOR, VECTOR, float64, float64, VECTOR) for M in COLUMNS), fast=FAST)
def sweeps(matrix, divisors, k, n, row_unit, unit, v_unit, push, x, of_u, of_v, omega, tolerance, errors):
    """Make at most `errors.size` sweeps, in place on x, of_u and of_v; returns how many were done.

    Parameters
    ----------
    matrix : K, see `COLUMNS`. divisors : (N,) d. The first n of x are free. errors : the judged error after each sweep.
    """
    for s in range(errors.size):
        for i in range(k.size):
            new = x[i] - omega * (of_u[i] + of_v[i] + k[i]) / divisors[i]
            if i >= n and not new > 0.0:  # also NaN becomes 0: the rows carry it on
                new = 0.0
            change = new - x[i]
            if change != 0.0:
                x[i] = new
                add_column(matrix, i, change, of_u if i < n else of_v)
        errors[s] = judged(k, n, row_unit, unit, x, of_u, of_v, v_unit, push)
        if not errors[s] > tolerance:
            return s + 1
    return errors.size
