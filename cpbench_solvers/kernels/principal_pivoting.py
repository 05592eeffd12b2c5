"""Principal pivoting on a whole tableau: Murty's least index, and the method of Cottle and Dantzig.

The tableau reads y = const + T x. Pair i has a basic variable y_i and a nonbasic one x_i: w_i and z_i at first, the
other way round where `swapped`. A pivot exchanges names and places, so values belong to variables and stay; the
constant is not kept. Every kernel goes on from the state that it, or a block pivot of the caller, has left.
"""

import numpy as np
from numba import njit

from cpbench_solvers.kernels.array_types import COMPILED

SOLVED, LIMIT, RAY, NOT_IN_CLASS, NOT_FINITE = 0, 1, 2, 3, 4
"""Nothing is negative; as many pivots as allowed; nothing blocks the driving variable; the diagonal entry of pair
`state[3]` is one that no matrix of the method's class has; not a number."""

_STATE = (
    "int64(float64[:,::1], float64[::1], float64[::1], boolean[::1], int64[::1], float64[::1], int64, float64, float64)"
)


@njit("void(float64[:,::1], int64, int64, float64[::1])", **COMPILED)
def exchange(T, r, s, row):
    """Exchange the basic variable of row r with the nonbasic variable of column s, in place; row : (n,) workspace.

    From y_r = T_r x: x_s = (y_r - Σ_{j≠s} T_rj x_j)/T_rs, put into the other rows (Cottle, Pang, Stone, 2.3).
    """
    n = T.shape[0]
    inverse = 1.0 / T[r, s]
    for j in range(n):
        row[j] = -T[r, j] * inverse
    row[s] = inverse
    for i in range(n):
        a = T[i, s]
        if a != 0.0 and i != r:
            T[i, s] = 0.0
            for j in range(n):
                T[i, j] += a * row[j]
    for j in range(n):
        T[r, j] = row[j]


@njit("void(float64[::1], float64[::1], boolean[::1], int64)", cache=True, nogil=True)
def _swap_names(y, x, swapped, s):
    y[s], x[s] = x[s], y[s]
    swapped[s] = not swapped[s]


@njit("void(float64[:,::1], float64[::1], float64[::1], boolean[::1], float64[::1], int64, int64)", **COMPILED)
def exchange_two(T, y, x, swapped, row, r, s):
    """Make the 2×2 principal pivot on pairs r and s where T_ss = 0: by the two entries off the diagonal."""
    exchange(T, s, r, row)  # two exchanges off the diagonal make one principal pivot, but for the names
    exchange(T, r, s, row)
    for j in range(T.shape[0]):
        T[r, j], T[s, j] = T[s, j], T[r, j]
    for i in range(T.shape[0]):
        T[i, r], T[i, s] = T[i, s], T[i, r]
    _swap_names(y, x, swapped, r)
    _swap_names(y, x, swapped, s)


@njit(_STATE, **COMPILED)
def murty(T, y, x, swapped, state, row, until, pivot_tolerance, zero):
    """Exchange the first pair that is negative, until none is (Murty 1974); all x are 0 throughout.

    Parameters
    ----------
    T : (n, n) tableau. y, x : (n,) values of the basic and the nonbasic variables. swapped : (n,) which y are z.
    state : pivots done, pair in hand (-1: none), major cycles done, pair that ends the run. row : (n,) workspace.
    until : pivots to stop at. pivot_tolerance : entries up to this are zero. zero : values above minus this are ≥ 0.
    """
    n = y.size
    while True:
        r = -1
        for i in range(n):
            if not np.isfinite(y[i]):
                return NOT_FINITE
            if y[i] < -zero:
                r = i
                break
        state[1] = r
        if r < 0:
            return SOLVED
        if not T[r, r] > pivot_tolerance:  # not positive: M is not a P-matrix, for which alone the least index ends
            state[3] = r
            return NOT_IN_CLASS
        if state[0] >= until:
            return LIMIT
        step = -y[r] / T[r, r]
        for i in range(n):
            y[i] += T[i, r] * step
        y[r], x[r] = 0.0, step
        exchange(T, r, r, row)
        _swap_names(y, x, swapped, r)
        state[0] += 1
        state[2] += 1


@njit("int64(float64[::1], float64[::1], int64[::1], float64)", cache=True, nogil=True)
def _pair_in_hand(y, x, state, zero):
    """Return the pair in hand or, where there is none, take that whose basic or nonbasic variable lies lowest, the
    first of several; -1 where none is negative."""
    if state[1] >= 0:
        return state[1]
    least, r = -zero, -1
    for i in range(y.size):
        lower = min(y[i], x[i])  # x is not 0 for the pair in hand
        if lower < least:
            least, r = lower, i
    state[1] = r
    return r


@njit(_STATE, **COMPILED)
def cottle_dantzig(T, y, x, swapped, state, row, until, pivot_tolerance, zero):
    """Drive x_r up until its own pair is complementary again, pivoting where another variable meets its bound.

    A variable is bounded by 0 once it is nonnegative, before by `row[n]` = λ < min q, which nothing passes: for
    a sufficient T (P and semidefinite are) a driving variable that nothing blocks proves that there is no solution
    (Cottle, Pang, Stone, algorithm 4.3.5). Ties: the least index. Parameters as `murty`, row : (n+1,).
    """
    n = y.size
    below = row[n]
    work = row[:n]
    while True:
        r = _pair_in_hand(y, x, state, zero)
        if r < 0:
            return SOLVED
        if state[0] >= until:
            return LIMIT
        if T[r, r] < -pivot_tolerance:
            state[3] = r
            return NOT_IN_CLASS
        step, s = np.inf, -1
        if x[r] < 0.0:
            # its basic variable is nonnegative: the pair is complementary when x_r is 0
            step = -x[r]
        elif T[r, r] > pivot_tolerance:
            step, s = -y[r] / T[r, r], r
        for i in range(n):
            if i != r and T[i, r] < -pivot_tolerance:
                # those below zero may fall to λ, and no further
                room = max(y[i], 0.0) if y[i] >= -zero else y[i] - below
                if room < -step * T[i, r]:
                    step, s = max(room, 0.0) / -T[i, r], i
        if step == np.inf:
            return RAY if np.isfinite(T[r, r]) else NOT_FINITE
        if not np.isfinite(step):
            return NOT_FINITE
        # a sufficient matrix has one of the two pivots
        if s >= 0 and not (T[s, s] > pivot_tolerance or (abs(T[s, s]) <= pivot_tolerance < T[r, s])):
            state[3] = s
            return NOT_IN_CLASS
        for i in range(n):
            y[i] += T[i, r] * step
        x[r] += step
        if s < 0:
            x[r] = 0.0
            state[1] = -1
            state[2] += 1
            continue
        y[s] = 0.0 if s == r or y[s] > 0.5 * below else below  # it stays at the bound that it met
        if T[s, s] > pivot_tolerance:
            exchange(T, s, s, work)
            _swap_names(y, x, swapped, s)
        else:
            exchange_two(T, y, x, swapped, work, r, s)
        state[0] += 1
        if s == r:
            state[1] = -1
            state[2] += 1
