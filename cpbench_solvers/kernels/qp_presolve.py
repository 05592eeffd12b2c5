"""What can be read off a quadratic program before it is solved, and the way back of its answer.

min ½zᵀQz + pᵀz subject to Gz ≥ b in the first m rows and Gz = b in the others, lb ≤ z ≤ ub. One after the other, until
nothing is left to do:

FIX        z_j has equal bounds, or is in no row and no product: it is at the bound that its cost asks for.
SINGLETON  a row with one unknown is a bound.
FREE       an unknown without bounds that is in one row only, and in no product, is what this row leaves to it; its cost
           is the multiplier of the row, and goes to the others.
DUPLICATE  of rows that are multiples of each other the tighter one is left.

A row without unknowns is left out. Andersen and Andersen 1995, Math. Programming 71:221.

Back, in the reverse order: ν of a FIX by stationarity; of a SINGLETON whose bound was the tighter one, the multiplier
is that of the bound; the multiplier of DUPLICATE rows belongs to the tighter one.
"""

import numpy as np

from cpbench.foundation.kernels import boolean, float64, helper, int32, int64, kernel, tuple_of, void
from cpbench_solvers.kernels.qp_ldl import CSR, DATA, INT, OUT, OUT2

FIX, SINGLETON, FREE, DUPLICATE = 0, 1, 2, 3
PASSES = 20
SAME, STABLE = 1e-12, 1e-3
"""Numbers that differ by less than this share are the same; a pivot of FREE is at least this share of its row."""
_FLAGS = boolean[::1]
_OPS = int64[:, ::1]
_OWN = tuple_of(int32[::1], int32[::1], float64[::1])


@kernel(_OWN(CSR, int64))
def transposed(M, columns):
    """Return the columns of M as rows."""
    rows = M[0].size - 1
    indptr = np.zeros(columns + 1, np.int32)
    for q in range(M[0][rows]):
        indptr[M[1][q] + 1] += 1
    for j in range(columns):
        indptr[j + 1] += indptr[j]
    at = indptr.copy()
    indices, data = np.empty(M[0][rows], np.int32), np.empty(M[0][rows])
    for i in range(rows):
        for q in range(M[0][i], M[0][i + 1]):
            k = at[M[1][q]]
            indices[k], data[k] = i, M[2][q]
            at[M[1][q]] += 1
    return indptr, indices, data


@helper(boolean(float64, float64))
def _apart(a, b):
    return abs(a - b) > SAME * max(1.0, abs(a), abs(b))


@helper(int64(CSR, INT, int64, OUT, _FLAGS, _FLAGS, OUT, _OPS, OUT2, int64))
def _duplicates(G, left, m, b, rows, columns, key, ops, numbers, count):
    """Leave the tighter one of rows that are multiples of each other; return the number of operations, −1 where two
    equations contradict each other."""
    r = b.size
    for i in range(r):
        key[i] = np.inf
        if rows[i] and left[i] > 1:
            first, total = 0.0, 0.0
            for q in range(G[0][i], G[0][i + 1]):
                j = G[1][q]
                if columns[j]:
                    first = G[2][q] if first == 0.0 else first
                    # a hash of pattern and ratios: golden-ratio weights collide by chance only
                    total += (1.0 + (np.float64(j) * 0.6180339887498949) % 1.0) * (G[2][q] / first)
            key[i] = total
    order = np.argsort(key)  # multiples of each other are neighbours then
    for k in range(1, r):
        i, j = order[k - 1], order[k]
        if not key[j] < np.inf:
            break
        # an inequality and an equation are never the same
        if not rows[i] or _apart(key[i], key[j]) or left[i] != left[j] or (i < m) != (j < m):
            continue
        p, q, ratio, same = G[0][i], G[0][j], 0.0, True
        for _ in range(left[i]):
            while not columns[G[1][p]]:
                p += 1
            while not columns[G[1][q]]:
                q += 1
            ratio = G[2][q] / G[2][p] if ratio == 0.0 else ratio
            if G[1][p] != G[1][q] or abs(G[2][q] - ratio * G[2][p]) > SAME * abs(G[2][q]):
                same = False
                break
            p += 1
            q += 1
        if not same or not abs(ratio) > 0.0 or (i < m and ratio < 0.0):  # −row ≥ b is another side of it
            continue
        # row j is ratio times row i: row j stays, for the next one is compared with it
        if i >= m and _apart(ratio * b[i], b[j]):
            return -1
        owned = i < m and ratio * b[i] > b[j]
        ops[count, 0], ops[count, 1], ops[count, 2], ops[count, 3] = DUPLICATE, i, j, owned
        numbers[count, 0] = ratio
        count += 1
        if owned:
            b[j] = ratio * b[i]
        rows[i] = False
    return count


@kernel(int64(CSR, CSR, CSR, int64, OUT, OUT, OUT, OUT, _FLAGS, _FLAGS, OUT, OUT, _OPS, OUT2))
def reduce(Q, G, Gt, m, p, b, lb, ub, rows, columns, z, y, ops, numbers):
    """Do all that can be done and return the number of operations, −1 where the program seems to have no solution.

    Parameters
    ----------
    Gt : the columns of G. p, b, lb, ub : changed into those of what is left. rows (r,), columns (n,) : all true; what
    is left. z (n,), y (r,) : values of FIX, multipliers of FREE. ops (n + r, 4) : kind, row, column, whether its lower
    (1) or upper (2) bound came from there. numbers (n + r, 1) : the entry or the ratio.
    """
    n, r, count = p.size, b.size, 0
    left, uses, products = np.empty(r, np.int64), np.empty(n, np.int64), np.zeros(n, np.int64)
    for i in range(r):
        left[i] = G[0][i + 1] - G[0][i]
    for j in range(n):
        uses[j] = Gt[0][j + 1] - Gt[0][j]
        for q in range(Q[0][j], Q[0][j + 1]):
            products[j] += Q[2][q] != 0.0
    for _ in range(PASSES):
        before = count
        for i in range(r):
            if not rows[i]:
                continue
            if left[i] == 0:
                size = max(1.0, abs(b[i]))
                if (b[i] if i < m else abs(b[i])) > 1e-9 * size:  # 0 ≥ b or 0 = b
                    return -1
                rows[i] = False
            elif left[i] == 1:
                j, a = -1, 0.0
                for q in range(G[0][i], G[0][i + 1]):
                    if columns[G[1][q]]:
                        j, a = G[1][q], G[2][q]
                if a == 0.0:  # a stored zero: it bounds nothing
                    continue
                bound, side = b[i] / a, 0  # which bound came from the row decides whose multiplier it is later
                if (i >= m or a > 0.0) and bound > lb[j]:
                    lb[j], side = bound, 1
                if (i >= m or a < 0.0) and bound < ub[j]:
                    ub[j], side = bound, side + 2
                if lb[j] > ub[j]:
                    if _apart(lb[j], ub[j]):
                        return -1
                    lb[j] = ub[j] = bound  # they cross by rounding only
                ops[count, 0], ops[count, 1], ops[count, 2], ops[count, 3] = SINGLETON, i, j, side
                numbers[count, 0] = a
                count += 1
                rows[i] = False
                uses[j] -= 1
        for j in range(n):
            if not columns[j]:
                continue
            if lb[j] == ub[j] or (uses[j] == 0 and products[j] == 0):
                value = lb[j]
                if lb[j] < ub[j]:
                    # without products and rows its cost alone decides; 0 or the next point where it is free
                    value = lb[j] if p[j] > 0.0 else ub[j] if p[j] < 0.0 else min(max(0.0, lb[j]), ub[j])
                if not abs(value) < np.inf:  # unbounded, or infeasible: the caller looks at the whole
                    return -1
                z[j] = value
                columns[j] = False
                ops[count, 0], ops[count, 2] = FIX, j
                count += 1
                for q in range(Gt[0][j], Gt[0][j + 1]):
                    b[Gt[1][q]] -= Gt[2][q] * value
                    left[Gt[1][q]] -= 1
                for q in range(Q[0][j], Q[0][j + 1]):
                    p[Q[1][q]] += Q[2][q] * value
                    products[Q[1][q]] -= Q[2][q] != 0.0
            elif uses[j] == 1 and products[j] == 0 and lb[j] == -np.inf and ub[j] == np.inf:
                i, a, top = -1, 0.0, 0.0
                for q in range(Gt[0][j], Gt[0][j + 1]):
                    if rows[Gt[1][q]]:
                        i, a = Gt[1][q], Gt[2][q]
                for q in range(G[0][i], G[0][i + 1]):
                    if columns[G[1][q]]:
                        top = max(top, abs(G[2][q]))
                # a small pivot would enlarge the errors of the others in z_j
                if i < 0 or abs(a) < STABLE * top or left[i] < 2:
                    continue
                y[i] = p[j] / a
                if i < m and y[i] < 0.0:  # stationarity fixes y_i, and its sign forbids it: no solution
                    return -1
                for q in range(G[0][i], G[0][i + 1]):
                    k = G[1][q]
                    if columns[k]:
                        p[k] -= G[2][q] * y[i]  # the cost of z_j, moved to the unknowns that it is made of
                        uses[k] -= 1
                rows[i], columns[j] = False, False
                ops[count, 0], ops[count, 1], ops[count, 2] = FREE, i, j
                numbers[count, 0] = a
                count += 1
        if count == before:
            break
    return _duplicates(G, left, m, b, rows, columns, np.empty(r), ops, numbers, count)


@kernel(void(CSR, CSR, CSR, int64, DATA, DATA, OUT, OUT, OUT, _OPS, OUT2, int64))
def restore(Q, G, Gt, m, p, b, z, y, nu, ops, numbers, count):
    """Complete z, y and ν of what is left, z and y of what `reduce` has written. p, b : as they were asked."""
    for k in range(count - 1, -1, -1):  # backwards: what went first needs all the others
        kind, i, j = ops[k, 0], ops[k, 1], ops[k, 2]
        if kind == FIX:
            value = p[j]
            for q in range(Q[0][j], Q[0][j + 1]):
                value += Q[2][q] * z[Q[1][q]]
            for q in range(Gt[0][j], Gt[0][j + 1]):
                value -= Gt[2][q] * y[Gt[1][q]]
            nu[j] = value
        elif kind == SINGLETON:
            side = ops[k, 3]
            if (nu[j] > 0.0 and side & 1) or (nu[j] < 0.0 and side & 2):  # the bound that is active came from this row
                y[i] = nu[j] / numbers[k, 0]
                nu[j] = 0.0
        elif kind == FREE:
            value = b[i]
            for q in range(G[0][i], G[0][i + 1]):
                if G[1][q] != j:
                    value -= G[2][q] * z[G[1][q]]
            z[j], nu[j] = value / numbers[k, 0], 0.0
        elif ops[k, 3] and y[j] > 0.0:  # the side of row i was the tighter one
            y[i] = y[j] * numbers[k, 0]
            y[j] = 0.0


@kernel(_OWN(CSR, _FLAGS, _FLAGS))
def left_of(M, rows, columns):
    """Return the rows and columns of M that are left."""
    place = np.empty(columns.size, np.int32)
    at = 0
    for j in range(columns.size):
        place[j] = at
        at += columns[j]
    indptr = np.zeros(rows.sum() + 1, np.int32)
    indices, data = np.empty(M[1].size, np.int32), np.empty(M[1].size)
    at = row = 0
    for i in range(rows.size):
        if not rows[i]:
            continue
        for q in range(M[0][i], M[0][i + 1]):
            if columns[M[1][q]]:
                indices[at], data[at] = place[M[1][q]], M[2][q]
                at += 1
        row += 1
        indptr[row] = at
    return indptr, indices[:at].copy(), data[:at].copy()
