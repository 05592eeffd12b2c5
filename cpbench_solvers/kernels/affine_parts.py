"""An affine problem in a box by its connected parts: rows f = Kx + c beside x, and the units that make them even.

x are unknowns and, after them, multipliers of rows G: K = [[M, −Gᵀ], [G, 0]], M any square matrix. Rows and columns
have units of their own: D_i |K_ij| C_j is 1 on average in every row and column. Rows share a size where unknowns join
them, those beside multipliers apart from the others.
"""

import numpy as np
from numba import int64, njit, types, void

from cpbench_solvers.kernels.array_types import COMPILED, DATA, INDEX, VECTOR
from cpbench_solvers.kernels.equilibration import equilibrate
from cpbench_solvers.kernels.qp_ldl import CSR
from cpbench_solvers.kernels.qp_parts import boxed, conditions, numbered
from cpbench_solvers.kernels.row_errors import label_parts

AFFINE = types.Tuple((int64, INDEX, INDEX, DATA, DATA, DATA, DATA, INDEX, DATA, INDEX, DATA, INDEX))
"""n; K in CSR: row starts, columns, numbers; c, low and high, the box of x; the number of the connected part of every
row, from 0; D, times which rows are compared; the number of the group of every row that shares its size, from 0; of
every group the largest |D_i c_i|; and the group of every row again, less than twice as many: without multipliers,
equalities have one of their own."""
_LABELS = types.int64[::1]
_OUT = types.Tuple((int64, _LABELS, _LABELS, VECTOR, VECTOR, VECTOR, VECTOR, _LABELS, VECTOR, _LABELS, VECTOR, _LABELS))


@njit(void(INDEX, INDEX, DATA, VECTOR, _LABELS), **COMPILED)
def _evened(start, column, value, D, group):
    """Write D and the number of the rows that unknowns join, for K in CSR without zeros."""
    N, entries = D.size, column.size
    begin, beside, size = np.empty(2 * N + 1, np.int64), np.empty(2 * entries, np.int64), np.empty(2 * entries)
    begin[: N + 1] = start
    begin[N + 1 :] = 0  # rows and columns side by side, 2N nodes: |K| as the bipartite graph that equilibration takes
    for k in range(entries):
        begin[N + 1 + column[k]] += 1
    for j in range(N):
        begin[N + 1 + j] += begin[N + j]
    at = begin[N : 2 * N].copy()
    for i in range(N):
        for k in range(start[i], start[i + 1]):
            j = column[k]
            beside[k], size[k] = N + j, abs(value[k])  # of row i
            beside[at[j]], size[at[j]] = i, abs(value[k])  # of column j
            at[j] += 1
    both, label = np.empty(2 * N), np.empty(2 * N, np.int64)
    equilibrate(begin, beside, size, N, both)  # rows and columns by themselves: M need not be symmetric
    label_parts((begin, beside, size), label)
    # D times a number and C over it are as good: let the logarithms of C bear the size of K, as alternate scalings do
    total, count = np.zeros(2 * N), np.zeros(2 * N)
    for j in range(N, 2 * N):
        for k in range(begin[j], begin[j + 1]):
            total[label[j]] += np.log(both[j] * size[k])
            count[label[j]] += 1.0
    for i in range(N):
        own = group[i] = label[i]
        # the mean logarithm, which no order of the rows changes
        D[i] = both[i] * np.exp(total[own] / count[own]) if count[own] > 0.0 else both[i]


@njit(_OUT(CSR, CSR, DATA, DATA, int64, DATA, DATA), **COMPILED)
def affine(M, G, q, h, m, lb, ub):
    """Return the `AFFINE` of Mz + q in [lb, ub] with rows G, the first m of which are inequalities Gz ≥ h."""
    n, N = q.size, q.size + h.size
    start, column, value = conditions(M, G)
    part, group, D = numbered(start, column, value), np.empty(N, np.int64), np.empty(N)
    _evened(start, column, value, D, group)
    c, low, high = boxed(q, h, m, lb, ub)
    number, groups = np.full(2 * N, -1), 0
    for i in range(N):
        own = group[i] + (N if i >= n else 0)  # rows beside multipliers have a unit of their own
        if number[own] < 0:
            number[own] = groups
            groups += 1
        group[i] = number[own]
    constants, kind = np.zeros(groups), group.copy()
    for i in range(N):
        constants[group[i]] = max(constants[group[i]], D[i] * abs(c[i]))
        if n == N and low[i] == -np.inf and high[i] == np.inf:
            kind[i] += groups
    return n, start, column, value, c, low, high, part, D, group, constants, kind
