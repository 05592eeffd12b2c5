"""Block Gauss–Seidel on an LCP: the unknowns of a block together, by Lemke's method; w = Mz + q is carried along."""

import numpy as np
from numba import float64, int64, njit

from cpbench_solvers.kernels.array_types import DATA, KEPT, VECTOR
from cpbench_solvers.kernels.lcp_error import judged
from cpbench_solvers.kernels.splitting import COLUMNS, add_column
from cpbench_solvers.kernels.tableau import CODES, COMPLEMENTARY, whole_tableau

PIVOT_TOLERANCE, TIE_TOLERANCE = 1e-11, 1e-13
_add_column = njit(error_model="numpy", forceinline=True)(add_column.py_func)
"""Here products are rounded before they are added."""


@njit(int64(VECTOR, int64, float64, float64[:, ::1], VECTOR, VECTOR, float64[::1], int64[::1]), **KEPT)
def solve_block(z, first, omega, block, w, new, reals, numbers):
    """Write `new` from z and w of the unknowns that begin at `first`; 1 where something moves, else 0.

    A block that Lemke's method does not solve (a ray: it is neither P nor copositive plus) has its unknowns relaxed one
    after the other, those with a positive diagonal. Workspace: reals (5b + 4 + b(b + 2)), numbers (8b + 4).
    """
    m = block.shape[0]
    rest = True
    for i in range(m):
        rest &= z[first + i] == 0.0 and w[first + i] >= 0.0  # most blocks near a solution: no Lemke for them
    if rest:
        return 0
    q = reals[:m]
    for i in range(m):
        q[i] = w[first + i]  # the rest of the unknowns held: q_B = w_B − M_BB z_B
        for j in range(m):
            q[i] -= block[i, j] * z[first + j]
    tableau = reals[m : m + m * (m + 1)].reshape(m, m + 1)
    rows = reals[m + m * (m + 1) : m + (m + 4) * (m + 1)].reshape(4, m + 1)
    names = numbers[: 4 * (2 * m + 1)].reshape(4, 2 * m + 1)
    code = whole_tableau(block, q, new, tableau, rows, names, 50 * m + 50, PIVOT_TOLERANCE, TIE_TOLERANCE)
    if code % CODES != COMPLEMENTARY:
        for i in range(m):
            new[i] = z[first + i]
        for i in range(m):
            if block[i, i] > 0.0:
                slack = q[i]
                for j in range(m):
                    slack += block[i, j] * new[j]
                new[i] = max(0.0, new[i] - slack / block[i, i])
    moves = 0
    for i in range(m):
        new[i] = max(0.0, z[first + i] + omega * (new[i] - z[first + i]))  # ω > 1 may leave the orthant
        if new[i] != z[first + i]:
            moves = 1
    return moves


@njit(
    [int64(M, VECTOR, int64, DATA, VECTOR, VECTOR, float64, float64, float64, VECTOR) for M in COLUMNS],
    **KEPT,
)
def sweeps(matrix, blocks, size, q, z, w, z_unit, omega, tolerance, errors):
    """Make at most `errors.size` sweeps, in place on z and w; returns how many were done.

    Parameters
    ----------
    matrix : see `COLUMNS`. blocks : the diagonal blocks by rows, one after the other, of `size` unknowns each, the last
    of what is left. errors : the judged error after each sweep.
    """
    n = q.size
    new, reals, numbers = np.empty(size), np.empty(5 * size + 4 + size * (size + 2)), np.empty(8 * size + 4, np.int64)
    for s in range(errors.size):
        for first in range(0, n, size):
            m = min(size, n - first)
            block = blocks[first * size : first * size + m * m].reshape(m, m)
            if solve_block(z, first, omega, block, w, new, reals, numbers):
                for i in range(m):
                    change = new[i] - z[first + i]
                    if change != 0.0:
                        z[first + i] = new[i]
                        _add_column(matrix, first + i, change, w)
        errors[s] = judged(q, z, w, z_unit)
        if not errors[s] > tolerance:
            return s + 1
    return errors.size
