"""A quadratic program by its connected parts: one matrix of its conditions, and the units that make a part even.

Unknowns are x = (z, y), y the multipliers of the rows G of A and then of C, with the rows f = Kx + c beside them:
K = [[Q, −Gᵀ], [G, 0]], c = (p, −h), h the sides. x is in a box: the bounds of z, [0, ∞] for the multipliers of
inequalities, [−∞, ∞] for those of equalities.
"""

import numpy as np
from numba import int64, njit, types

from cpbench_solvers.kernels.array_types import COMPILED, DATA, INDEX, VECTOR
from cpbench_solvers.kernels.equilibration import equilibrate
from cpbench_solvers.kernels.qp_ldl import CSR
from cpbench_solvers.kernels.row_errors import label_parts
from cpbench_solvers.kernels.vectors import unsigned

ENDLESS = 1e19
"""Bounds and sides from here on are none."""
PROGRAM = types.Tuple((int64, INDEX, INDEX, DATA, DATA, DATA, DATA, INDEX, DATA, DATA, DATA))
"""n; K in CSR: row starts, columns, numbers; c, low and high, the box of x; the number of the connected part of every
row, from 0; D, times which rows are compared; of every part the largest |D_i c_i| beside z and then beside y; and
whether it has an objective, the square of which z is part of, or prices (2, 1, 0)."""
_OWN = types.Tuple((types.int64[::1], types.int64[::1], VECTOR))
_BOX = types.Tuple((VECTOR, VECTOR, VECTOR))
_OUT = types.Tuple((int64, *_OWN, VECTOR, VECTOR, VECTOR, types.int64[::1], VECTOR, VECTOR, VECTOR))


@njit(_OWN(CSR, CSR), **COMPILED)
def conditions(Q, G):
    """Return K in CSR, without zeros that are stored."""
    n, r, Q, G = Q[0].size - 1, G[0].size - 1, unsigned(Q), unsigned(G)
    start = np.zeros(n + r + 1, np.int64)
    for i in range(n):
        for q in range(Q[0][i], Q[0][i + 1]):
            start[i + 1] += Q[2][q] != 0.0  # stored zeros join nothing
    for i in range(r):
        for q in range(G[0][i], G[0][i + 1]):
            if G[2][q] != 0.0:
                start[n + i + 1] += 1
                start[G[1][q] + 1] += 1
    for i in range(n + r):
        start[i + 1] += start[i]
    at, column, value = start[:-1].copy(), np.empty(start[n + r], np.int64), np.empty(start[n + r])
    for i in range(n):
        for q in range(Q[0][i], Q[0][i + 1]):
            if Q[2][q] != 0.0:
                column[at[i]], value[at[i]] = Q[1][q], Q[2][q]
                at[i] += 1
    for i in range(r):
        for q in range(G[0][i], G[0][i + 1]):
            if G[2][q] != 0.0:
                j = G[1][q]
                column[at[n + i]], value[at[n + i]] = j, G[2][q]
                column[at[j]], value[at[j]] = n + i, -G[2][q]  # stationarity has −Gᵀy
                at[n + i] += 1
                at[j] += 1
    return start, column, value


@njit(types.int64[::1](INDEX, INDEX, DATA), **COMPILED)
def numbered(start, column, value):
    """Return the connected part of every row, numbered from 0."""
    part, count = np.empty(start.size - 1, np.int64), 0
    label_parts((start, column, value), part)  # by the least number of a row of theirs
    for i in range(part.size):
        if part[i] == i:
            part[i] = count
            count += 1
        else:
            part[i] = part[part[i]]  # the least row of a part comes first, and has its number already
    return part


@njit(types.int64[::1](CSR, CSR), **COMPILED)
def labels(Q, G):
    """Return the connected part of every unknown and row, numbered from 0."""
    start, column, value = conditions(Q, G)
    return numbered(start, column, value)


@njit(_BOX(DATA, DATA, int64, DATA, DATA), **COMPILED)
def boxed(p, h, m, lb, ub):
    """Return c, low and high: the constants of the rows, and the box of x, the first m rows of G being inequalities."""
    n, N = p.size, p.size + h.size
    c, low, high = np.empty(N), np.empty(N), np.full(N, np.inf)
    for i in range(N):
        if i < n:
            c[i] = p[i]
            low[i] = lb[i] if lb[i] > -ENDLESS else -np.inf  # files write 1e20 for no bound
            high[i] = ub[i] if ub[i] < ENDLESS else np.inf
        else:
            c[i], low[i] = -h[i - n], 0.0 if i < n + m else -np.inf
            if i < n + m and not h[i - n] > -ENDLESS:  # a row without a side, whose multiplier is 0
                c[i] = high[i] = 0.0
    return c, low, high


@njit(_OUT(CSR, CSR, DATA, DATA, int64, DATA, DATA), **COMPILED)
def program(Q, G, p, h, m, lb, ub):
    """Return the `PROGRAM` of a QP of which the first m rows of G are inequalities Gz ≥ h."""
    n, N = p.size, p.size + h.size
    start, column, value = conditions(Q, G)
    part, D = numbered(start, column, value), np.empty(N)
    equilibrate(start, column, value, n, D)
    D *= np.sqrt(0.5)  # of K + Kᵀ, which is twice as large
    c, low, high = boxed(p, h, m, lb, ub)
    count = 1 + part.max() if N else 0
    constants, objective = np.zeros(2 * count), np.zeros(count)
    for i in range(N):
        group = part[i] + (count if i >= n else 0)
        constants[group] = max(constants[group], D[i] * abs(c[i]))
        if i < n:
            if c[i] != 0.0:
                objective[part[i]] = max(objective[part[i]], 1.0)
            for k in range(start[i], start[i + 1]):
                if column[k] < n:
                    objective[part[i]] = 2.0  # curvature: the objective has the unit of z squared
    return n, start, column, value, c, low, high, part, D, constants, objective
