"""Lemke's complementary pivoting on a condensed tableau, with the lexicographic ratio test.

Variables are numbered w_i: i, z_i: n + i, z_0: 2n. The tableau reads x_B + T x_N = rhs, one column for every
nonbasic variable. Pivots are collected as T - U V and applied `U.shape[1]` at a time.
"""

import numpy as np
from numba import njit

FLUSH, COMPLEMENTARY, RAY, LIMIT, NOT_FINITE = 0, 1, 2, 3, 4
"""What `advance` returns: the caller has to apply U V; z_0 has left; no row blocks; too many pivots; NaN."""


@njit("float64(float64[:,::1], float64[:,::1], float64[:,::1], int64, int64, int64)", inline="always")
def _entry(T, U, V, k, i, j):
    a = T[i, j]
    for p in range(k):
        a -= U[i, p] * V[p, j]
    return a


@njit(
    "int64(float64[:,::1], float64[:,::1], float64[:,::1], int64, float64[::1], int64[::1], int64[::1], int64,"
    " int64, float64)",
    cache=True,
)
def _lexicographic_row(T, U, V, k, col, where, ties, count, last, tie_tolerance):
    """Among the tied rows the one whose (B⁻¹)_i./col_i is lexicographically least.

    The columns of B⁻¹ are those of the w_j: in the tableau when w_j is nonbasic, unit vectors otherwise. Ties that
    survive every column can only come from rounding; the largest pivot element is then the safest.
    """
    n = col.size
    value = np.empty(count)
    for place in range(n):
        if count == 1:
            break
        j = last if place == n - 1 else (place if place < last else place + 1)
        least = np.inf
        for t in range(count):
            i = ties[t]
            b = 1.0 if -where[j] - 1 == i else 0.0
            if where[j] >= 0:
                b = _entry(T, U, V, k, i, where[j])
            value[t] = b / col[i]
            least = min(least, value[t])
        kept = 0
        for t in range(count):
            i = ties[t]
            if (value[t] - least) * col[i] <= tie_tolerance * max(1.0, abs(least) * col[i]):
                ties[kept] = i
                kept += 1
        count = kept
    r = ties[0]
    for t in range(1, count):
        if col[ties[t]] > col[r]:
            r = ties[t]
    return r


@njit(
    "int64(float64[:,::1], float64[::1], int64[::1], int64[::1], int64[::1], float64[:,::1], float64[:,::1],"
    " int64[::1], int64, float64, float64, boolean)",
    cache=True,
)
def advance(T, rhs, basic, nonbasic, where, U, V, state, max_pivots, pivot_tolerance, tie_tolerance, inside):
    """Pivot until z_0 leaves, or until U V is full (the caller subtracts it from T, unless `inside`).

    Parameters
    ----------
    T : (n, n+1). rhs : (n,) values of the basic variables. basic, nonbasic : variable of each row, column.
    where : (2n+1,) column of a nonbasic variable, -(row + 1) of a basic one.
    U, V : (n, K), (K, n+1). state : pending pivots, entering column, pivots done, row of the first pivot (where rhs
    is least; last in the lexicographic order, which makes every other row lexicographically positive).
    """
    n = rhs.size
    K = U.shape[1]
    k = state[0]
    s = state[1]
    col = np.empty(n)
    row = np.empty(n + 1)
    ties = np.empty(n, np.int64)
    while True:
        if k == K:
            if not inside:
                state[0], state[1] = k, s
                return FLUSH
            for i in range(n):
                for p in range(K):
                    u = U[i, p]
                    if u != 0.0:
                        for j in range(n + 1):
                            T[i, j] -= u * V[p, j]
            k = 0
        if state[2] >= max_pivots:
            return LIMIT
        for i in range(n):
            col[i] = _entry(T, U, V, k, i, s)
        if state[2] == 0:
            r = state[3]
        else:
            best = np.inf
            first = -1
            for i in range(n):
                if not np.isfinite(col[i]):
                    return NOT_FINITE
                if col[i] > pivot_tolerance and rhs[i] < best * col[i]:
                    best = rhs[i] / col[i]
                    first = i
            if first < 0:
                return RAY
            count = 0
            r = -1
            for i in range(n):
                # best * col may round below rhs by more than the tolerance: the row of the minimum always counts
                if i == first or (col[i] > pivot_tolerance and rhs[i] <= best * col[i] + tie_tolerance):
                    ties[count] = i
                    count += 1
                    if basic[i] == 2 * n:
                        r = i
            if r < 0:
                r = ties[0]
                if count > 1:
                    r = _lexicographic_row(T, U, V, k, col, where, ties, count, state[3], tie_tolerance)
        for j in range(n + 1):
            row[j] = T[r, j]
        for p in range(k):
            u = U[r, p]
            if u != 0.0:
                for j in range(n + 1):
                    row[j] -= u * V[p, j]
        pivot = col[r]
        step = rhs[r] / pivot
        for i in range(n):
            rhs[i] -= col[i] * step
            if rhs[i] < 0.0 and state[2] > 0:
                rhs[i] = 0.0
        rhs[r] = step
        # row r and column s are written afresh, not corrected: no cancellation however large the pivot
        for j in range(n + 1):
            T[r, j] = 0.0
            V[k, j] = row[j] / pivot
        for p in range(k):
            U[r, p] = 0.0
            V[p, s] = 0.0
        for i in range(n):
            T[i, s] = 0.0
            U[i, k] = col[i]
        U[r, k] = -1.0
        V[k, s] = 1.0 / pivot
        k += 1
        leaving, entering = basic[r], nonbasic[s]
        basic[r], nonbasic[s] = entering, leaving
        where[entering], where[leaving] = -(r + 1), s
        state[2] += 1
        if leaving == 2 * n:
            state[0] = k
            return COMPLEMENTARY
        s = where[leaving + n if leaving < n else leaving - n]


READY = True
