"""Lemke's complementary pivoting on a whole tableau, for a few unknowns; and its lexicographic ratio test.

Variables are numbered w_i: i, z_i: n + i, z_0: 2n. The tableau reads x_B + T x_N = rhs, one column (slot) for every
nonbasic variable.
"""

import numpy as np

from cpbench.foundation.kernels import DATA, DATA_2D, MATRIX, VECTOR, float64, helper, int64, kernel, read_only
from cpbench_solvers.kernels.vectors import finite

ANY_ORDER = read_only(float64, 2, by_rows=False)
"""A matrix that is read only, by rows or by columns."""
COMPLEMENTARY, RAY, LIMIT, NOT_FINITE = 0, 1, 2, 3
"""z_0 has left; no row blocks; too many pivots; not a number."""
CODES = 8
"""Runs return pivots * CODES + outcome: a pair would cost more than a pivot does for n = 5."""


@kernel(int64(ANY_ORDER, DATA, int64[::1]))
def first_row(M, q, ties):
    """Return the row of the least q; of ties the r whose z_r, raised to w_r = 0, lifts w most (Σ_j M_jr/M_rr).

    On the worst cases of Murty and Fathi every row ties, and the first or the last of them costs 2ⁿ pivots.
    """
    n = q.size
    least, count = np.inf, 0
    for i in range(n):
        if q[i] < least:
            least, count = q[i], 0
        if q[i] == least:
            ties[count] = i
            count += 1
    best, r = -np.inf, ties[0]
    for t in range(count if count > 1 else 0):
        c = ties[t]
        lift = 0.0
        for i in range(n):
            lift += M[i, c]
        if M[c, c] > 0.0:
            lift /= M[c, c]
        if lift > best:
            best, r = lift, c  # the first of several, so that the way is the same every time
    return r


@helper(int64(VECTOR, VECTOR, int64[::1], int64[::1], float64, float64))
def blocking(col, rhs, basic, ties, pivot_tolerance, tie_tolerance):
    """Return how many rows block the entering variable, the rows in `ties`; -1 - row where z_0 is among them."""
    n = rhs.size
    best, first = np.inf, -1
    for i in range(n):
        if col[i] > pivot_tolerance and rhs[i] < best * col[i]:  # multiplied, not divided: most rows do not block
            best = rhs[i] / col[i]
            first = i
    if first < 0:
        return 0
    count = 0
    for i in range(n):
        # best * col may round below rhs by more than the tolerance: the row of the minimum always counts
        if col[i] > pivot_tolerance and (rhs[i] <= best * col[i] + tie_tolerance or i == first):
            if basic[i] == 2 * n:  # z_0 may leave: the end, whatever else is tied
                return -1 - i
            ties[count] = i
            count += 1
    return count


@helper(int64(VECTOR, VECTOR, int64[::1], int64, VECTOR, int64, float64))
def kept(column, col, ties, count, value, unit, tie_tolerance):
    """Return how many of the tied rows have the least ratio column/col, moved to the front of `ties`.

    `column` is one of B⁻¹; where `unit` ≥ 0 it is that unit vector instead.
    """
    least = np.inf
    for t in range(count):
        i = ties[t]
        # a w_j that is basic has a unit vector for its column
        b = column[i] if unit < 0 else (1.0 if unit == i else 0.0)
        value[t] = b / col[i]
        least = min(least, value[t])
    kept = 0
    for t in range(count):
        i = ties[t]
        # times the pivot: an absolute difference of the row
        if (value[t] - least) * col[i] <= tie_tolerance * max(1.0, abs(least) * col[i]):
            ties[kept] = i
            kept += 1
    return kept


@helper(int64(VECTOR, int64[::1], int64))
def largest(col, ties, count):
    """Return the row of the largest pivot, the safest: ties that survive every column can only come from rounding."""
    r = ties[0]
    for t in range(1, count):
        if col[ties[t]] > col[r]:
            r = ties[t]
    return r


@helper()
def data_sizes(M, q, column):
    """Return whether no q is negative, so that z = 0 is right; else max|M|, 1 for a matrix of zeros, and max|q| too.
    column : (n,) workspace."""
    n = q.size
    m = p = 0.0
    covered = True
    for i in range(n):
        p = max(p, abs(q[i]))
        covered &= q[i] >= 0.0
    if covered:
        return True, m, p
    # the largest of every column first: a loop that the compiler can turn into vector instructions
    column[:] = 0.0
    for i in range(n):
        for j in range(n):
            column[j] = max(column[j], abs(M[i, j]))
    for j in range(n):
        m = max(m, column[j])
    return False, m if m != 0.0 else 1.0, p


@helper(
    int64(
        DATA_2D,
        DATA,
        VECTOR,
        MATRIX,
        MATRIX,
        int64[:, ::1],
        int64,
        float64,
        float64,
    )
)
def whole_tableau(M, q, z, T, reals, numbers, max_pivots, pivot_tolerance, tie_tolerance):
    """Solve an LCP, scaled by max|M| and max|q|, to z of the basis that it ends in; return pivots * CODES + outcome.

    M : (n, n). q, z : (n,), z is written. Workspace: T (n, n+1), reals (4, n+1), numbers (4, 2n+1).
    """
    n = q.size
    z[:] = 0.0
    rhs, col, row, column = reals[0, :n], reals[1, :n], reals[2], reals[3, :n]
    covered, m, p = data_sizes(M, q, column)
    if covered:
        return COMPLEMENTARY
    basic, nonbasic, where, ties = numbers[0, :n], numbers[1, : n + 1], numbers[2], numbers[3]
    factor = -1.0 / m
    for i in range(n):
        rhs[i] = q[i] / p
        basic[i], where[i] = i, -(i + 1)
        nonbasic[i], where[n + i] = n + i, i
        for j in range(n):
            T[i, j] = factor * M[i, j]
        T[i, n] = -1.0  # the covering vector e
    nonbasic[n], where[2 * n] = 2 * n, n
    last = r = first_row(M, q, ties)
    s = n
    pivots = 0
    while True:
        if pivots >= max_pivots:
            outcome = LIMIT
            break
        for i in range(n):
            col[i] = T[i, s]
        if pivots > 0:
            count = blocking(col, rhs, basic, ties, pivot_tolerance, tie_tolerance)
            if count == 0:
                outcome = RAY if finite(col) and finite(rhs) else NOT_FINITE
                break
            if count < 0:
                r = -1 - count
            else:
                # the columns of B⁻¹, least to greatest in the order of the test, are those of the w_j
                for place in range(n):
                    if count == 1:
                        break
                    j = last if place == n - 1 else (place if place < last else place + 1)
                    if where[j] >= 0:
                        for t in range(count):
                            column[ties[t]] = T[ties[t], where[j]]
                    count = kept(column, col, ties, count, row, -where[j] - 1, tie_tolerance)
                r = largest(col, ties, count)
        inverse = 1.0 / col[r]
        step = rhs[r] * inverse
        # row r and column s are written afresh, not corrected: no cancellation however large the pivot
        for j in range(n + 1):
            row[j] = T[r, j] * inverse
        row[s] = inverse
        for i in range(n):
            a = col[i]
            if a != 0.0 and i != r:
                T[i, s] = 0.0
                for j in range(n + 1):
                    T[i, j] -= a * row[j]
                rhs[i] -= a * step
                if rhs[i] < 0.0 and pivots > 0:  # rounding: the ratio test keeps it ≥ 0
                    rhs[i] = 0.0
        for j in range(n + 1):
            T[r, j] = row[j]
        rhs[r] = step
        pivots += 1
        leaving, entering = basic[r], nonbasic[s]
        basic[r], nonbasic[s] = entering, leaving
        where[entering], where[leaving] = -(r + 1), s
        if leaving == 2 * n:
            outcome = COMPLEMENTARY
            break
        s = where[leaving + n if leaving < n else leaving - n]
    for i in range(n):
        if n <= basic[i] < 2 * n:
            z[basic[i] - n] = max(0.0, rhs[i]) * (p / m)
    return pivots * CODES + outcome
