"""Lemke's complementary pivoting where variables may have upper bounds, on columns updated when they are needed.

Pair b has the variables p_b, basic at first: b, and n_b: n + b; z_0 is 2n. All are at least 0, the tableau reads
x_B + T x_N = rhs. A variable that meets its upper bound u is replaced by u − x, and its complement by its negative:
both are then at least 0 again, and the path goes on as Lemke's. Columns and pivots are kept as in `pivoting`.
"""

import numpy as np

from cpbench.foundation.kernels import MATRIX, VECTOR, float64, helper, int64, kernel
from cpbench_solvers.kernels.pivoting import pivot, update
from cpbench_solvers.kernels.tableau import COMPLEMENTARY, LIMIT, NOT_FINITE, RAY
from cpbench_solvers.kernels.vectors import finite


@helper(int64(VECTOR, VECTOR, VECTOR, int64[::1], float64, int64[::1], float64, float64))
def blocking(col, rhs, upper, basic, own, ties, pivot_tolerance, tie_tolerance):
    """Count the rows that block the entering variable, in `ties`, n for its bound `own`; -1 - row where z_0 does."""
    n = rhs.size
    best, first = own, n
    for i in range(n):
        if col[i] > pivot_tolerance:
            if rhs[i] < best * col[i]:
                best, first = rhs[i] / col[i], i
        elif col[i] < -pivot_tolerance and upper[basic[i]] - rhs[i] < -best * col[i]:
            best, first = (upper[basic[i]] - rhs[i]) / -col[i], i
    if best == np.inf:
        return 0
    count = 0
    for i in range(n):
        room = np.inf
        if col[i] > pivot_tolerance:
            room = rhs[i] - best * col[i]
        elif col[i] < -pivot_tolerance:
            room = upper[basic[i]] - rhs[i] + best * col[i]
        # best * col may round below rhs by more than the tolerance: the row of the minimum always counts
        if room <= tie_tolerance or i == first:
            if basic[i] == 2 * n:
                return -1 - i
            ties[count] = i
            count += 1
    if own <= best + tie_tolerance:
        ties[count] = n
        count += 1
    return count


@helper(int64(VECTOR, VECTOR, int64[::1], int64, VECTOR, int64, float64, float64))
def kept(column, col, ties, count, value, unit, sign, tie_tolerance):
    """Return how many of the tied have the least ratio sign * column/col, moved to the front of `ties`; 0 is that of n.

    `column` is one of B⁻¹ but for the sign of its variable; where `unit` ≥ 0 it is that unit vector instead.
    """
    n = col.size
    least = np.inf
    for t in range(count):
        i = ties[t]
        if i == n:
            value[t] = 0.0
        else:
            value[t] = sign * (column[i] if unit < 0 else (1.0 if unit == i else 0.0)) / col[i]
        least = min(least, value[t])
    kept = 0
    for t in range(count):
        size = abs(col[ties[t]]) if ties[t] < n else 1.0
        if (value[t] - least) * size <= tie_tolerance * max(1.0, abs(least) * size):
            ties[kept] = ties[t]
            kept += 1
    return kept


@helper(int64(VECTOR, int64[::1], int64))
def largest(col, ties, count):
    """Choose, of ties that no column breaks, a bound that needs no pivot, else the largest pivot element."""
    n = col.size
    r = ties[0]
    for t in range(count):
        if ties[t] == n:
            return n
        if abs(col[ties[t]]) > abs(col[r]):
            r = ties[t]
    return r


@helper()
def _turn(column, other, sign, pair):
    """Count a pair from its other bound: the columns of its two variables change their signs."""
    sign[pair] = -sign[pair]
    for i in range(column.size):
        column[i] = -column[i]
        other[i] = -other[i]


@kernel(
    int64(
        MATRIX,
        MATRIX,
        int64[::1],
        MATRIX,
        int64[::1],
        VECTOR,
        VECTOR,
        int64[::1],
        int64[::1],
        int64[::1],
        VECTOR,
        int64[::1],
        int64[::1],
        VECTOR,
        int64,
        float64,
        float64,
    )
)
def follow(
    D, C, age, E, rows, rhs, upper, basic, nonbasic, where, sign, state, ties, value,
    most, pivot_tolerance, tie_tolerance,
):  # fmt: skip
    """Pivot until z_0 leaves, nothing blocks, or `most` pivots and changes of bounds are done.

    Parameters
    ----------
    D : (n, n), p = D n + rhs + cover z_0. C : (n+1, n) column of each slot. age : (n+1,) how many of the kept pivots
    are in it. E : (K, n) columns that entered, rows : (K,) where. rhs : (n,) values of the basic variables.
    upper : (2n+1,) bounds. basic, nonbasic : variable of each row, slot. where : (2n+1,) slot of a nonbasic variable,
    else -(row + 1). sign : (n,) -1 for pairs that are turned. state : kept pivots, entering slot, pivots done, row of
    the first pivot. ties, value : (n+1,) workspace.
    """
    n = rhs.size
    while True:
        if state[2] >= most:
            return LIMIT
        if state[0] == E.shape[0]:
            for slot in range(n + 1):
                update(D.T, -1.0, C, age, slot, E, rows, state[0])
                age[slot] = 0
            state[0] = 0
        k, s = state[0], state[1]
        col = C[s]
        update(D.T, -1.0, C, age, s, E, rows, k)
        entering = nonbasic[s]
        if state[2] == 0:
            r = state[3]
        else:
            count = blocking(col, rhs, upper, basic, upper[entering], ties, pivot_tolerance, tie_tolerance)
            if count == 0:
                return RAY if finite(col) and finite(rhs) else NOT_FINITE
            if count < 0:
                r = -1 - count
            else:
                # the columns of B⁻¹, in the order of the test, are those of the p_b
                for place in range(n):
                    if count == 1:
                        break
                    b = state[3] if place == n - 1 else (place if place < state[3] else place + 1)
                    slot = where[b]
                    if slot >= 0:
                        update(D.T, -1.0, C, age, slot, E, rows, k)
                    count = kept(C[max(slot, 0)], col, ties, count, value, -slot - 1, sign[b], tie_tolerance)
                r = largest(col, ties, count)
        state[2] += 1
        if r == n:
            # the entering variable goes from one bound to the other, and its complement drives
            for i in range(n):
                rhs[i] = max(rhs[i] - col[i] * upper[entering], 0.0)
            state[1] = where[entering + n if entering < n else entering - n]
            _turn(col, C[state[1]], sign, entering if entering < n else entering - n)
            continue
        leaving = basic[r]
        # it leaves at its upper bound; the row of the first pivot is that of the least rhs, whatever the sign
        turned = col[r] < 0.0 and state[2] > 1
        pivot(col, rhs, E[k], r, rhs[r] - upper[leaving] if turned else rhs[r], state[2] > 1)
        age[s] = k + 1
        rows[k] = r
        basic[r], nonbasic[s] = entering, leaving
        where[entering], where[leaving] = -(r + 1), s
        state[0] = k + 1
        if leaving == 2 * n:
            return COMPLEMENTARY
        complement = leaving + n if leaving < n else leaving - n
        state[1] = where[complement]
        if turned:
            update(D.T, -1.0, C, age, state[1], E, rows, k + 1)
            _turn(col, C[state[1]], sign, min(leaving, complement))
