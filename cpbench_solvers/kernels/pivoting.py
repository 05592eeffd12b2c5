"""Lemke's complementary pivoting with the lexicographic ratio test, on columns that are updated when they are needed.

Variables are numbered w_i: i, z_i: n + i, z_0: 2n. The tableau reads x_B + T x_N = rhs, one column (slot) for every
nonbasic variable. Every column is kept as it was after the first `age` pivots, and the pivots themselves as the
columns that entered. A column is read from M and brought up to date when it enters, one pivot after the other.
Columns that never enter, half of them in most problems, cost nothing.

Reference in plain NumPy: `tests/solvers/references/lemke.py`.
"""

import numpy as np

from cpbench.foundation.kernels import DATA, DATA_2D, MATRIX, VECTOR, float64, helper, int64, kernel, void
from cpbench_solvers.kernels.tableau import (
    ANY_ORDER,
    CODES,
    COMPLEMENTARY,
    LIMIT,
    NOT_FINITE,
    RAY,
    blocking,
    data_sizes,
    first_row,
    kept,
    largest,
    whole_tableau,
)
from cpbench_solvers.kernels.vectors import finite

BEHIND, FULL = 4, 5
"""Two more outcomes of `advance`: a column is unknown; there is no room for more pivots."""
SPARE = 8
"""Room for pivots beyond n: most runs never fill it."""
WHOLE = 16
"""Up to this size the whole tableau is updated at once: a column at a time would be more calls than arithmetic."""
UNKNOWN = -(2**40)
"""The age of a column that cannot be read from M: the caller brings it."""


@kernel(void(ANY_ORDER, float64, MATRIX, int64[::1], int64, MATRIX, int64[::1], int64))
def update(columns, factor, C, age, slot, E, rows, end):
    """Bring a column to `end` pivots, from M (row j of `columns` is its column j) where it was never used (age -1).

    A pivot in row r makes c_r t = c_r/e_r and every other c_i less by e_i t; E holds 1/e_r in the place of e_r. Row r
    is written afresh, not corrected: no cancellation however large the pivot.
    """
    column = C[slot]
    if age[slot] < 0:
        for i in range(column.size):
            column[i] = factor * columns[slot, i]
        age[slot] = 0
    for p in range(age[slot], end):
        r = rows[p]
        if column[r] == 0.0:
            continue
        t = column[r] * E[p, r]
        for i in range(column.size):
            column[i] -= E[p, i] * t
        column[r] = t
    age[slot] = end


@helper()
def pivot(col, rhs, entered, r, room, later):
    """Let the column `col` enter in row r, whose variable has `room` to its bound: kept in `entered`, taken from rhs.

    Afterwards `col` is the unit column of the leaving variable. later : not the first pivot.
    """
    inverse = 1.0 / col[r]
    step = room * inverse
    for i in range(rhs.size):
        a = col[i]
        entered[i] = a
        col[i] = -a * inverse
        rhs[i] -= a * step
    if later:  # before the first pivot what is negative is the problem's, after it rounding
        for i in range(rhs.size):
            rhs[i] = max(rhs[i], 0.0)
    rhs[r] = step
    entered[r] = col[r] = inverse  # E keeps the reciprocal: later updates multiply


@kernel(
    int64(
        *(ANY_ORDER, float64, MATRIX, int64[::1], MATRIX, int64[::1], VECTOR),
        *(int64[::1], int64[::1], int64[::1], int64[::1], int64[::1], VECTOR, int64, float64, float64),
    )
)
def advance(
    columns, factor, C, age, E, rows, rhs, basic, nonbasic, where, state, ties, value,
    max_pivots, pivot_tolerance, tie_tolerance,
):  # fmt: skip
    """Pivot until z_0 leaves, or until the caller has work.

    Parameters
    ----------
    columns : (n, n), those of M, multiplied by `factor` when read. C : (n+1, n) column of each slot. age : (n+1,)
    how many of the kept pivots are in it. E : (K, n) columns that entered, rows : (K,) where. rhs : (n,) values of the
    basic variables. basic, nonbasic : variable of each row, slot. where : (2n+1,) slot of a nonbasic variable, else
    -(row + 1).
    state : kept pivots, entering slot, pivots done, row of the first pivot (where rhs is least; last in the
    lexicographic order, which makes every other row lexicographically positive), slot of the column that the caller
    has to bring. ties, value : (n,) workspace.
    """
    n = rhs.size
    while True:
        k, s = state[0], state[1]
        if state[2] >= max_pivots:
            return LIMIT
        if k == E.shape[0]:
            return FULL
        if age[s] == UNKNOWN:
            state[4] = s
            return BEHIND
        col = C[s]
        update(columns, factor, C, age, s, E, rows, k)  # only now: columns that never enter stay as they were in M
        if state[2] == 0:
            r = state[3]  # the first pivot makes the right-hand side nonnegative
        else:
            count = blocking(col, rhs, basic, ties, pivot_tolerance, tie_tolerance)
            if count == 0:
                return RAY if finite(col) and finite(rhs) else NOT_FINITE
            if count < 0:
                r = -1 - count
            else:
                # the columns of B⁻¹, in the order of the test, are those of the w_j
                for place in range(n):
                    if count == 1:
                        break
                    j = state[3] if place == n - 1 else (place if place < state[3] else place + 1)
                    slot = where[j]
                    if slot >= 0:
                        if age[slot] == UNKNOWN:
                            state[4] = slot
                            return BEHIND
                        update(columns, factor, C, age, slot, E, rows, k)
                    count = kept(C[max(slot, 0)], col, ties, count, value, -slot - 1, tie_tolerance)
                r = largest(col, ties, count)
        pivot(col, rhs, E[k], r, rhs[r], state[2] > 0)
        age[s] = k + 1
        rows[k] = r
        leaving, entering = basic[r], nonbasic[s]
        basic[r], nonbasic[s] = entering, leaving
        where[entering], where[leaving] = -(r + 1), s
        state[0] = k + 1
        state[2] += 1
        if leaving == 2 * n:
            return COMPLEMENTARY
        state[1] = where[leaving + n if leaving < n else leaving - n]


@kernel(
    int64(
        DATA_2D,
        DATA,
        VECTOR,
        MATRIX,
        MATRIX,
        MATRIX,
        int64[:, ::1],
        int64,
        float64,
        float64,
    )
)
def solve(M, q, z, C, E, reals, numbers, max_pivots, pivot_tolerance, tie_tolerance):
    """Run `lemke` in workspace: C (n+1, n), E (K, n), reals (2, n), numbers (7, max(2n+1, K))."""
    n = q.size
    z[:] = 0.0
    rhs, value = reals[0], reals[1]
    covered, m, p = data_sizes(M, q, value)
    if covered:
        return COMPLEMENTARY
    basic, nonbasic, where, age = numbers[0, :n], numbers[1, : n + 1], numbers[2], numbers[3, : n + 1]
    rows, ties, state = numbers[4], numbers[5], numbers[6]
    for i in range(n):
        rhs[i] = q[i] / p  # size one: tolerances are absolute
        basic[i], where[i] = i, -(i + 1)
        nonbasic[i], where[n + i] = n + i, i
        age[i] = -1
        C[n, i] = -1.0
    nonbasic[n], where[2 * n], age[n] = 2 * n, n, 0
    state[0], state[1], state[2], state[3] = 0, n, 0, first_row(M, q, ties)
    while True:
        columns, tableau = (M.T, -1.0 / m, C, age, E, rows), (rhs, basic, nonbasic, where, state, ties, value)
        outcome = advance(*columns, *tableau, max_pivots, pivot_tolerance, tie_tolerance)
        if outcome != FULL:
            break
        for slot in range(n + 1):
            update(M.T, -1.0 / m, C, age, slot, E, rows, state[0])
            age[slot] = 0
        state[0] = 0
    for i in range(n):
        if n <= basic[i] < 2 * n:
            z[basic[i] - n] = max(0.0, rhs[i]) * (p / m)
    return state[2] * CODES + outcome


@kernel(int64(DATA_2D, DATA, VECTOR, int64, float64, float64))
def lemke(M, q, z, max_pivots, pivot_tolerance, tie_tolerance):
    """Solve one LCP from its data to z of the basis it ends in, all by vector updates; scales by max|M| and max|q|.

    Returns pivots * CODES + outcome. M : (n, n). q, z : (n,), z is written.
    """
    n = q.size
    if n <= WHOLE:
        work = np.empty((n + 4, n + 1))  # one, for to ask for memory takes as long as a pivot of a few rows
        T, reals = work[:n], work[n:]
        numbers = np.empty((4, 2 * n + 1), np.int64)
        return whole_tableau(M, q, z, T, reals, numbers, max_pivots, pivot_tolerance, tie_tolerance)
    C, E, reals = np.empty((n + 1, n)), np.empty((n + SPARE, n)), np.empty((2, n))
    numbers = np.empty((7, 2 * n + SPARE), np.int64)
    return solve(M, q, z, C, E, reals, numbers, max_pivots, pivot_tolerance, tie_tolerance)
