"""LDLᵀ of a sparse quasi-definite matrix in a fixed order, row after row; what becomes dense is factored densely.

The matrix comes as the columns of its upper triangle, without the diagonal, which is apart. Columns from `tail` on are
not eliminated: what is left of them is their dense Schur complement. Davis 2005, ACM Trans. Math. Softw. 31:587
(up-looking, by the elimination tree).
"""

import numpy as np

from cpbench.foundation.kernels import (
    DATA,
    boolean,
    float64,
    helper,
    int32,
    int64,
    kernel,
    read_only,
    tuple_of,
    uint32,
    void,
)
from cpbench_solvers.kernels.qp_dense import dot
from cpbench_solvers.kernels.vectors import put

BLOCK = 48
"""Columns that a dense factorization eliminates at once; what they do to the rest is one product of matrices."""
INDEX = read_only(int32)
CSR = tuple_of(INDEX, INDEX, DATA)
"""Row pointers, columns, numbers."""
OUT = float64[::1]
OUT2 = float64[:, ::1]
INT = int64[::1]
ROWS = uint32[::1]  # unsigned: a signed index costs a test for negative ones
_COLUMNS = int32[::1]


@kernel(void(CSR, CSR, INT, _COLUMNS, _COLUMNS))
def adjacency(H, G, starts, indptr, indices):
    """Write the pattern of [[H, Gᵀ], [G, 0]] without its diagonal. starts : work, (n + r,). indices : of size
    nnz(H) + 2 nnz(G) at least."""
    n, r = H[0].size - 1, G[0].size - 1
    starts[:] = 0
    for i in range(n):
        for q in range(H[0][i], H[0][i + 1]):
            starts[i] += H[1][q] != i  # the diagonal is apart
    for i in range(r):
        for q in range(G[0][i], G[0][i + 1]):
            starts[G[1][q]] += 1
            starts[n + i] += 1
    indptr[0] = 0
    for i in range(n + r):
        indptr[i + 1] = indptr[i] + starts[i]
        starts[i] = indptr[i]
    for i in range(n):
        for q in range(H[0][i], H[0][i + 1]):
            if H[1][q] != i:
                indices[starts[i]] = H[1][q]
                starts[i] += 1
    for i in range(r):
        for q in range(G[0][i], G[0][i + 1]):
            j = G[1][q]
            indices[starts[j]], indices[starts[n + i]] = n + i, j
            starts[j] += 1
            starts[n + i] += 1


@kernel(void(CSR, CSR, INT, INT, INT, _COLUMNS, _COLUMNS, OUT, OUT))
def permuted(H, G, place, starts, ends, indptr, indices, data, diagonal):
    """Write the columns of the upper triangle of [[H, Gᵀ], [G, 0]], unknown i at place[i], and its diagonal apart.

    starts, ends : work, (N,). H is symmetric: its entries above the diagonal are read.
    """
    n, r = H[0].size - 1, G[0].size - 1
    starts[:] = 0
    diagonal[:] = 0.0
    for fill in range(2):
        for i in range(n + r):
            here = H if i < n else G
            row = i if i < n else i - n
            for q in range(here[0][row], here[0][row + 1]):
                j = here[1][q]
                if i < n and j <= i:
                    if fill == 0 and j == i:
                        diagonal[place[i]] += here[2][q]
                    continue
                a, b = place[i], place[j]  # an entry goes to the column of whichever is eliminated later
                column, at = max(a, b), min(a, b)
                if fill == 0:
                    starts[column] += 1
                else:
                    indices[ends[column]], data[ends[column]] = at, here[2][q]
                    ends[column] += 1
        if fill == 0:
            indptr[0] = 0
            for k in range(n + r):
                indptr[k + 1] = indptr[k] + starts[k]
                ends[k] = indptr[k]


@kernel(void(INDEX, INDEX, INT, INT))
def tree(indptr, indices, parent, count):
    """Write the elimination tree and entries below the diagonal of every column of L. parent, count : (N,)."""
    N = parent.size
    seen = np.full(N, -1, np.int64)
    for k in range(N):
        parent[k], count[k], seen[k] = -1, 0, k
        for q in range(indptr[k], indptr[k + 1]):
            i = np.int64(indices[q])
            while i < k and seen[i] != k:  # up the tree as far as row k has not been: each entry of L once
                if parent[i] < 0:
                    parent[i] = k
                count[i] += 1
                seen[i] = k
                i = parent[i]


@kernel(boolean(INDEX, INDEX, DATA, DATA, INT, INT, ROWS, OUT, OUT, OUT2, int64))
def factor(indptr, indices, data, diagonals, parent, starts, rows, L, D, S, tail):
    """Return L and D of the columns before `tail`, S (N - tail)² the lower triangle of the rest; False at a NaN
    and where a diagonal entry is 0.

    starts : (tail + 1,) of the columns of L in rows, L. D : (tail,).
    """
    N = parent.size
    y = np.zeros(N)
    seen = np.full(N, -1, np.int64)
    end = np.empty(tail, np.int64)
    put(end, starts)
    pattern, path = np.empty(N, np.int64), np.empty(N, np.int64)
    for k in range(N):
        top = tail
        diagonal = diagonals[k]
        for q in range(indptr[k], indptr[k + 1]):
            i = np.int64(indices[q])
            y[i] += data[q]
            length = 0
            while i < min(k, tail) and seen[i] != k:  # the pattern of row k of L: reach of its entries in the tree
                path[length] = i
                length += 1
                seen[i] = k
                i = parent[i]
            while length > 0:
                length -= 1
                top -= 1
                # paths in front of each other: descendants come first, as substitution needs
                pattern[top] = path[length]
        for t in range(top, tail):
            c = pattern[t]
            value = y[c]
            y[c] = 0.0
            last = end[c]
            for q in range(np.uint64(starts[c]), np.uint64(last)):  # unsigned: no test for negative indices in the loop
                y[rows[q]] -= L[q] * value
            scaled = value / D[c]
            diagonal -= value * scaled
            rows[last], L[last] = np.uint32(k), scaled  # columns grow by one entry a row: no sorting
            end[c] = last + 1
        if k < tail:
            # a pivot has the sign of its diagonal entry; one that rounding has turned is what it was
            D[k] = diagonals[k] if diagonal * diagonals[k] <= 0.0 else diagonal
            if not abs(D[k]) > 0.0:
                return False
        else:
            for i in range(tail, k):
                S[k - tail, i - tail] = y[i]
                y[i] = 0.0  # the work is clean again for the next row
            S[k - tail, k - tail] = diagonal
    return True


@helper(boolean(OUT2, OUT, int64, int64))
def _factor_block(S, diagonals, begin, end):
    """Overwrite a diagonal block by its L and D; False at a NaN and at a pivot of 0."""
    for i in range(begin, end):
        row = S[i]
        for c in range(begin, i):
            row[c] -= dot(row[begin:c], S[c, begin:c])  # L[i, c] D[c] until the row is done
        pivot = row[i]
        for c in range(begin, i):
            value = row[c] / S[c, c]
            pivot -= value * row[c]
            row[c] = value
        row[i] = diagonals[i] if pivot * diagonals[i] <= 0.0 else pivot
        if not abs(row[i]) > 0.0:
            return False
    return True


@helper(void(OUT2, int64, int64, OUT2, boolean))
def substitute(S, begin, end, columns, unit):
    """Set every column of `columns`, (end - begin, ·), to L⁻¹ times it, L that of a diagonal block, with ones on its
    diagonal where `unit`.

    All columns at once: loops over rows of L are short.
    """
    for c in range(end - begin):
        row = columns[c]
        for k in range(c):
            value, earlier = S[begin + c, begin + k], columns[k]
            for i in range(row.size):
                row[i] -= value * earlier[i]
        if not unit:
            pivot = S[begin + c, begin + c]
            for i in range(row.size):
                row[i] /= pivot


@kernel(boolean(OUT2, OUT))
def dense_factor(S, diagonals):
    """Overwrite the lower triangle of a quasi-definite S by L below its diagonal and D on it; False at a NaN.

    diagonals : (N,) those of the whole matrix.
    """
    N = S.shape[0]
    for begin in range(0, N, BLOCK):
        end = min(begin + BLOCK, N)
        width = end - begin
        if not _factor_block(S, diagonals, begin, end):
            return False
        if end == N:
            return True
        scaled, plain = np.empty((width, N - end)), np.empty((N - end, width))
        for i in range(N - end):
            for c in range(width):
                scaled[c, i] = S[end + i, begin + c]
        substitute(S, begin, end, scaled, True)
        for i in range(N - end):
            for c in range(width):
                plain[i, c] = scaled[c, i] / S[begin + c, begin + c]
                S[end + i, begin + c] = plain[i, c]
        for left in range(end, N, 2 * BLOCK):  # only the lower triangle, by strips: half of the products
            right = min(left + 2 * BLOCK, N)
            change = np.dot(plain[left - end :], np.ascontiguousarray(scaled[:, left - end : right - end]))
            for i in range(left, N):
                for c in range(left, min(i + 1, right)):
                    S[i, c] -= change[i - left, c - left]
    return True


@kernel(void(OUT2, OUT))
def dense_solve(S, x):
    """Set x ← (LDLᵀ)⁻¹x by the factors of `dense_factor`."""
    N = x.size
    for i in range(N):
        x[i] -= dot(S[i, :i], x[:i])
    for i in range(N):
        x[i] /= S[i, i]
    for i in range(N - 1, -1, -1):
        row, value = S[i], x[i]
        for k in range(i):
            x[k] -= row[k] * value


@helper(void(INT, ROWS, DATA, OUT, int64))
def forward(starts, rows, L, x, tail):
    """Set x ← L⁻¹x."""
    for c in range(tail):
        value = x[c]
        for q in range(np.uint64(starts[c]), np.uint64(starts[c + 1])):
            x[rows[q]] -= L[q] * value


@helper(void(INT, ROWS, DATA, DATA, OUT, int64))
def backward(starts, rows, L, D, x, tail):
    """Set x ← L⁻ᵀD⁻¹x."""
    for c in range(tail - 1, -1, -1):
        value = x[c] / D[c]
        for q in range(np.uint64(starts[c]), np.uint64(starts[c + 1])):
            value -= L[q] * x[rows[q]]
        x[c] = value
