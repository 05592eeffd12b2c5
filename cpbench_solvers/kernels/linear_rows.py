"""Rows f = Kx + c beside unknowns x in a box, with what their errors need of the problem alone (`linear_error`).

x is z and, after it, the multipliers y of rows G: K = [[M, −Gᵀ], [G, 0]], c = (q, −h), h the sides. The box has the
bounds of z, [0, ∞] for multipliers of inequalities, [−∞, ∞] for those of equalities.
"""

import numpy as np

from cpbench.foundation.kernels import DATA, INDEX, VECTOR, boolean, helper, int64, kernel, read_only, tuple_of, void
from cpbench_solvers.kernels.equilibration import equilibrate
from cpbench_solvers.kernels.qp_ldl import CSR
from cpbench_solvers.kernels.row_errors import joined, label_parts, root
from cpbench_solvers.kernels.vectors import unsigned

ENDLESS = 1e19
"""Bounds and sides from here on are none."""
SYMMETRY = 1e-12
"""Share of its size by which an entry may differ from the one across the diagonal, as `cpbench.foundation` has it."""
FLAGS = read_only(boolean)
LINEAR = tuple_of(int64, INDEX, INDEX, DATA, DATA, DATA, DATA, INDEX, FLAGS, DATA, DATA, boolean, boolean)
"""How many z there are; K in CSR: row starts, columns, numbers; c, low and high, the box of x; the number of the group
of rows that are measured together, from 0; whether an unknown is no multiplier; D and C, times which rows, and over
which unknowns, are compared; whether the rows are those of a program; whether multipliers are a certificate only."""
_LABELS = int64[::1]
_OWN = _LABELS, _LABELS, VECTOR
_BOX = tuple_of(VECTOR, VECTOR, VECTOR)
_OUT = tuple_of(int64, *_OWN, VECTOR, VECTOR, VECTOR, _LABELS, boolean[::1], VECTOR, VECTOR, boolean, boolean)


@helper(tuple_of(*_OWN)(CSR, CSR))
def conditions(M, G):
    """Return K in CSR, without zeros that are stored."""
    n, r, M, G = M[0].size - 1, G[0].size - 1, unsigned(M), unsigned(G)
    start = np.zeros(n + r + 1, np.int64)
    for i in range(n):
        for q in range(M[0][i], M[0][i + 1]):
            start[i + 1] += M[2][q] != 0.0  # stored zeros join nothing
    for i in range(r):
        for q in range(G[0][i], G[0][i + 1]):
            if G[2][q] != 0.0:
                start[n + i + 1] += 1
                start[G[1][q] + 1] += 1
    for i in range(n + r):
        start[i + 1] += start[i]
    at, column, value = start[:-1].copy(), np.empty(start[n + r], np.int64), np.empty(start[n + r])
    for i in range(n):
        for q in range(M[0][i], M[0][i + 1]):
            if M[2][q] != 0.0:
                column[at[i]], value[at[i]] = M[1][q], M[2][q]
                at[i] += 1
    for i in range(r):
        for q in range(G[0][i], G[0][i + 1]):
            if G[2][q] != 0.0:
                j = G[1][q]
                column[at[n + i]], value[at[n + i]] = j, G[2][q]
                column[at[j]], value[at[j]] = n + i, -G[2][q]  # the gradient has −Gᵀy
                at[n + i] += 1
                at[j] += 1
    return start, column, value


@helper(_LABELS(INDEX, INDEX, DATA))
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


@kernel(_LABELS(CSR, CSR))
def labels(M, G):
    """Return the connected part of every unknown and row, numbered from 0."""
    return numbered(*conditions(M, G))


@helper(_BOX(DATA, DATA, int64, DATA, DATA))
def boxed(q, h, m, lb, ub):
    """Return c, low and high: the constants of the rows, and the box of x, the first m rows of G being inequalities."""
    n, N = q.size, q.size + h.size
    c, low, high = np.empty(N), np.empty(N), np.full(N, np.inf)
    for i in range(N):
        if i < n:
            c[i] = q[i]
            low[i] = lb[i] if lb[i] > -ENDLESS else -np.inf  # files write 1e20 for no bound
            high[i] = ub[i] if ub[i] < ENDLESS else np.inf
        else:
            c[i], low[i] = -h[i - n], 0.0 if i < n + m else -np.inf
            if i < n + m and not h[i - n] > -ENDLESS:  # a row without a side, whose multiplier is 0
                c[i] = high[i] = 0.0
    return c, low, high


@helper(tuple_of(*_OWN)(INDEX, INDEX, DATA))
def _transposed(start, column, value):
    """Return Kᵀ in CSR."""
    begin, place, size = np.zeros(start.size, np.int64), np.empty(column.size, np.int64), np.empty(value.size)
    for j in column:
        begin[j + 1] += 1
    for j in range(start.size - 1):
        begin[j + 1] += begin[j]
    at = begin[:-1].copy()
    for i in range(start.size - 1):
        for k in range(start[i], start[i + 1]):
            j = column[k]
            place[at[j]], size[at[j]] = i, value[k]
            at[j] += 1
    return begin, place, size


@helper(boolean(INDEX, INDEX, DATA, boolean[::1]))
def oriented(start, column, value, z):
    """Write which unknowns are no multipliers; return whether all rows are conditions of programs.

    K is symmetric then, but for the signs of the rows of multipliers; of each part the first unknown is none.
    """
    n = z.size
    begin, place, size = _transposed(start, column, value)
    across, twice, even, largest, apart = np.zeros(n), np.arange(2 * n), True, 0.0, 0.0
    for i in range(n):
        for k in range(begin[i], begin[i + 1]):
            across[place[k]] = size[k]
        for k in range(start[i], start[i + 1]):
            j, one, other = column[k], value[k], across[column[k]]
            most = max(abs(one), abs(other))
            largest, apart = max(largest, most), max(apart, abs(one - other))
            even = even and abs(abs(one) - abs(other)) <= SYMMETRY * most
            if one * other != 0.0:  # twice every unknown: as it is, and as a multiplier
                crossed = n if one * other < 0.0 else 0
                joined(twice, i, j + crossed)
                joined(twice, i + n, j + n - crossed)
        for k in range(begin[i], begin[i + 1]):
            across[place[k]] = 0.0
    z[:] = True
    if apart <= SYMMETRY * largest:
        return True
    for i in range(n):
        z[i] = root(twice, i) < root(twice, i + n)
        even = even and root(twice, i) != root(twice, i + n)
    if not even:
        z[:] = True
    return even


@helper(void(INDEX, INDEX, DATA, VECTOR, VECTOR))
def _evened(start, column, value, D, C):
    """Write D and C for a K that is not symmetric, in CSR without zeros: it is one block of a matrix that is."""
    N, entries = D.size, column.size
    turned = _transposed(start, column, value)
    begin, beside, size = np.empty(2 * N + 1, np.int64), np.empty(2 * entries, np.int64), np.empty(2 * entries)
    for i in range(N + 1):
        begin[i], begin[N + i] = start[i], entries + turned[0][i]
    for k in range(entries):
        beside[k], size[k] = N + column[k], abs(value[k])
        beside[entries + k], size[entries + k] = turned[1][k], abs(turned[2][k])
    both = np.empty(2 * N)
    equilibrate(begin, beside, size, N, both)
    for i in range(N):
        D[i], C[i] = both[i], both[N + i]


@helper(void(INDEX, INDEX, VECTOR))
def _balance(start, column, D):
    """Let both sides of a part in which entries join only unknowns of different sides, as in linear programs, have the
    same mean logarithm: D of one side times a number, and of the other over it, scales as well."""
    N = D.size
    twice, total, count = np.arange(2 * N), np.zeros(2 * N), np.zeros(2 * N)
    for i in range(N):
        for k in range(start[i], start[i + 1]):
            joined(twice, i, column[k] + N)
            joined(twice, i + N, column[k])
    for i in range(N):
        side, entries = root(twice, i), start[i + 1] - start[i]
        total[side] += entries * np.log(D[i])
        count[side] += entries
    for i in range(N):
        own, other = root(twice, i), root(twice, i + N)
        if own != other and count[own] > 0.0:
            D[i] *= np.exp(0.5 * (total[other] / count[other] - total[own] / count[own]))


@kernel(_OUT(CSR, CSR, DATA, DATA, int64, DATA, DATA, boolean))
def linear(M, G, q, h, m, lb, ub, certifying):
    """Return the `LINEAR` of Mz + q in [lb, ub] with rows G, the first m of which are inequalities Gz ≥ h.

    Parameters
    ----------
    certifying : whether it is a quadratic program.
    """
    n, N = q.size, q.size + h.size
    start, column, value = conditions(M, G)
    c, low, high = boxed(q, h, m, lb, ub)
    z, D, C = np.arange(N) < n, np.ones(N), np.ones(N)
    program = certifying or oriented(start, column, value, z)
    if program:
        equilibrate(start, column, value, n if certifying else N, D)
        _balance(start, column, D)
        C[:] = D
        group = np.zeros(N, np.int64)
    else:
        _evened(start, column, value, D, C)
        group = numbered(start, column, value)
    return n, start, column, value, c, low, high, group, z, D, C, program, certifying
