"""LDLᵀ of a sparse quasi-definite matrix in a fixed order, row after row; what becomes dense is left to LAPACK.

The matrix comes as the upper triangle of its columns. Columns from `tail` on are not eliminated: what is left of them
is their dense Schur complement. Davis 2005, ACM Trans. Math. Softw. 31:587 (up-looking, by the elimination tree).
"""

import numpy as np
from numba import njit, types

from cpbench.solvers.kernels.vectors import put

_DATA = types.Array(types.float64, 1, "C", readonly=True)
_INDEX = types.Array(types.int32, 1, "C", readonly=True)
_OUT = types.float64[::1]
_INT = types.int64[::1]
_ROWS = types.uint32[::1]  # unsigned: a signed index costs a test for negative ones
_FAST = {"cache": True, "error_model": "numpy", "nogil": True}


@njit(types.void(_INDEX, _INDEX, _INT, _INT), **_FAST)
def tree(indptr, indices, parent, count):
    """Write the elimination tree and entries below the diagonal of every column of L. parent, count : (N,)."""
    N = parent.size
    seen = np.full(N, -1, np.int64)
    for k in range(N):
        parent[k], count[k], seen[k] = -1, 0, k
        for q in range(indptr[k], indptr[k + 1]):
            i = np.int64(indices[q])
            while i < k and seen[i] != k:
                if parent[i] < 0:
                    parent[i] = k
                count[i] += 1
                seen[i] = k
                i = parent[i]


@njit(types.boolean(_INDEX, _INDEX, _DATA, _INT, _INT, _ROWS, _OUT, _OUT, types.float64[:, ::1], types.int64), **_FAST)
def factor(indptr, indices, data, parent, starts, rows, L, D, S, tail):
    """Return L and D of the columns before `tail`, S (N - tail)² the lower triangle of the rest; False at a pivot 0 or
    NaN.

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
        diagonal = 0.0
        for q in range(indptr[k], indptr[k + 1]):
            i = np.int64(indices[q])
            if i == k:
                diagonal += data[q]
                continue
            y[i] += data[q]
            length = 0
            while i < min(k, tail) and seen[i] != k:
                path[length] = i
                length += 1
                seen[i] = k
                i = parent[i]
            while length > 0:
                length -= 1
                top -= 1
                pattern[top] = path[length]
        for t in range(top, tail):
            c = pattern[t]
            value = y[c]
            y[c] = 0.0
            last = end[c]
            for q in range(np.uint64(starts[c]), np.uint64(last)):
                y[rows[q]] -= L[q] * value
            scaled = value / D[c]
            diagonal -= value * scaled
            rows[last], L[last] = np.uint32(k), scaled
            end[c] = last + 1
        if k < tail:
            D[k] = diagonal
            if not abs(diagonal) > 0.0:
                return False
        else:
            for i in range(tail, k):
                S[k - tail, i - tail] = y[i]
                S[i - tail, k - tail] = y[i]
                y[i] = 0.0
            S[k - tail, k - tail] = diagonal
    return True


@njit(types.void(_INT, _ROWS, _DATA, _OUT, types.int64), **_FAST)
def forward(starts, rows, L, x, tail):
    """Set x ← L⁻¹x."""
    for c in range(tail):
        value = x[c]
        for q in range(np.uint64(starts[c]), np.uint64(starts[c + 1])):
            x[rows[q]] -= L[q] * value


@njit(types.void(_INT, _ROWS, _DATA, _DATA, _OUT, types.int64), **_FAST)
def backward(starts, rows, L, D, x, tail):
    """Set x ← L⁻ᵀD⁻¹x."""
    for c in range(tail - 1, -1, -1):
        value = x[c] / D[c]
        for q in range(np.uint64(starts[c]), np.uint64(starts[c + 1])):
            value -= L[q] * x[rows[q]]
        x[c] = value


READY = True
