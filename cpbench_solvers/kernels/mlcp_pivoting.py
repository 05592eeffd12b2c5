"""Pivots on a tableau with free unknowns: all of them into the basis, then Lemke's method on the pairs that remain.

y = Kx + k, the first n of y are zero (equalities) and of x free, the others complementary. Basic variables are those
that a row of the tableau expresses: at first y_i (numbered i) in row i, while x_j (numbered N + j) has column j. The
tableau is N x (N + 1), k in its last column.
"""

import numpy as np

from cpbench.foundation.kernels import DATA, float64, helper, int64, kernel, void
from cpbench_solvers.kernels.mlcp_judged import error_with
from cpbench_solvers.kernels.pivoting import WHOLE, lemke
from cpbench_solvers.kernels.tableau import CODES as CODES
from cpbench_solvers.kernels.tableau import COMPLEMENTARY, whole_tableau
from cpbench_solvers.kernels.tableau import LIMIT as LIMIT
from cpbench_solvers.kernels.tableau import RAY as RAY

INCONSISTENT, STUCK, RIGHT = 5, 6, 7
"""More outcomes: an equality without unknowns is not zero; free unknowns are left for which no pivot was found; the
judged error is within the tolerance, wherever the pivots have ended."""
HEAD = 6
"""Numbers before the matrix in what `lemke_mixed` reads: n, v_unit, push, and the tolerances of rank, pivots, ties."""
ROUNDING = 1e-13
"""Of what is left after the elimination of free unknowns, data having size one."""
IDLE = 1e-12
"""Of the largest v of a start, in scaled units: what is left of a v whose basis has it at 0; with it in the basis the
matrix may be singular."""
VECTOR, MATRIX, INDEX = float64[::1], float64[:, ::1], int64[::1]


@helper(void(MATRIX, INDEX, INDEX, int64, int64))
def exchange(T, basic, nonbasic, r, s):
    """Make the variable of column s basic in row r. Row and column of the pivot are written afresh."""
    inverse = 1.0 / T[r, s]
    for j in range(T.shape[1]):
        T[r, j] *= -inverse
    T[r, s] = inverse
    for i in range(T.shape[0]):
        factor = T[i, s]
        if i != r and factor != 0.0:
            T[i, s] = 0.0  # before the loop, which adds the new entry to it
            for j in range(T.shape[1]):
                T[i, j] += factor * T[r, j]
    basic[r], nonbasic[s] = nonbasic[s], basic[r]


@helper(void(int64, int64, INDEX, INDEX, INDEX, INDEX))
def _number(N, n, basic, nonbasic, row_of, column_of):
    """Give the variables their numbers before any exchange."""
    for i in range(N):
        basic[i], nonbasic[i] = i, N + i
    for k in range(N - n):
        row_of[k] = column_of[k] = n + k


@helper()
def _largest(T, rows, columns, left, tolerance):
    """Return the largest size of the entries that are left, and its places; -1 where none is above the tolerance."""
    best, p, q = tolerance, -1, -1
    for i in range(left):
        for j in range(left):
            size = abs(T[rows[i], columns[j]])
            if size > best:
                best, p, q = size, i, j
    return best, p, q


@kernel(int64(MATRIX, int64, INDEX, INDEX, INDEX, INDEX, float64))
def reduce(T, n, basic, nonbasic, row_of, column_of, tolerance):
    """Bring the free unknowns into the basis; what is left is an LCP of the pairs (row_of[k], column_of[k]).

    First by pivots on the equalities, the largest entry of all first. Where A is singular, equality and unknown that
    are left take a pair with them, [[0, c], [d, b]]: v_k enters for the equality, the free unknown for w_k, and the
    pair has exchanged its roles. Where no pair has both c and d, a pivot of a pair with itself mixes them.

    Returns COMPLEMENTARY, or INCONSISTENT or STUCK when equalities are left over.
    basic, nonbasic : (N,). row_of, column_of : (m,).
    """
    N = T.shape[0]
    m = N - n
    tried = np.zeros(m, np.bool_)
    _number(N, n, basic, nonbasic, row_of, column_of)
    rows, columns = np.arange(n), np.arange(n)
    left = n
    while left > 0:
        best, p, q = _largest(T, rows, columns, left, tolerance)
        if p >= 0:
            exchange(T, basic, nonbasic, rows[p], columns[q])
        else:
            pair, c_row, mixing, largest = -1, -1, -1, tolerance
            c_top = d_top = 0.0
            for k in range(m):
                c, d, at = 0.0, 0.0, -1
                for i in range(left):
                    if abs(T[rows[i], column_of[k]]) > c:
                        c, at = abs(T[rows[i], column_of[k]]), i
                    d = max(d, abs(T[row_of[k], columns[i]]))
                # both links must exist somewhere, else no mixing makes a pair
                c_top, d_top = max(c_top, c), max(d_top, d)
                if min(c, d) > best:
                    best, pair, c_row = min(c, d), k, at
                own = abs(T[row_of[k], column_of[k]])
                if max(c, d) > tolerance and not tried[k] and own > largest:
                    largest, mixing = own, k
            # no pair links an equality and an unknown that are left
            if min(c_top, d_top) <= tolerance or (pair < 0 and mixing < 0):
                break
            if pair < 0:
                tried[mixing] = True  # once for each pair: two such pivots undo each other
                exchange(T, basic, nonbasic, row_of[mixing], column_of[mixing])
                continue
            p = c_row
            exchange(T, basic, nonbasic, rows[p], column_of[pair])
            size = -1.0
            for j in range(left):
                if abs(T[row_of[pair], columns[j]]) > size:
                    size, q = abs(T[row_of[pair], columns[j]]), j
            exchange(T, basic, nonbasic, row_of[pair], columns[q])
            row_of[pair], column_of[pair] = rows[p], columns[q]  # w_k and v_k have changed their places in the pair
        left -= 1
        rows[p], columns[q] = rows[left], columns[left]
    outcome = COMPLEMENTARY
    for i in range(left):
        for k in range(m):
            if abs(T[rows[i], column_of[k]]) > tolerance:
                return STUCK
        if abs(T[rows[i], N]) > tolerance:
            outcome = INCONSISTENT  # 0 = number: the equalities contradict each other
    return outcome


@kernel(void(MATRIX, VECTOR))
def without_rounding(M, q):
    """Set what is left of a difference of equal numbers to 0: Lemke's method scales M and would enlarge it."""
    for i in range(q.size):
        if abs(q[i]) <= ROUNDING:
            q[i] = 0.0
        for j in range(q.size):
            if abs(M[i, j]) <= ROUNDING:
                M[i, j] = 0.0


@kernel(void(MATRIX, INDEX, INDEX, MATRIX, VECTOR))
def remaining(T, row_of, column_of, M, q):
    """Write the LCP of the pairs: M (m, m) and q (m,)."""
    for k in range(row_of.size):
        q[k] = T[row_of[k], T.shape[0]]
        for j in range(row_of.size):
            M[k, j] = T[row_of[k], column_of[j]]
    without_rounding(M, q)


@kernel(void(MATRIX, int64, INDEX, INDEX, INDEX, INDEX, DATA, VECTOR))
def recover(T, n, basic, nonbasic, row_of, column_of, z, x):
    """Write x of the whole problem from z of the pairs; free unknowns that are idle are 0."""
    N = T.shape[0]
    x[:] = 0.0
    for k in range(z.size):
        if nonbasic[column_of[k]] >= N:
            x[nonbasic[column_of[k]] - N] = z[k]
    for i in range(N):
        j = basic[i] - N
        if j >= 0:
            value = T[i, N]
            for k in range(z.size):
                value += T[i, column_of[k]] * z[k]
            x[j] = value if j < n else max(value, 0.0)  # a v in the basis is ≥ 0 but for rounding
    for k in range(z.size):
        # what is complementary to a positive unknown is zero, not a rounding error
        if z[k] > 0.0 and basic[row_of[k]] >= N + n:
            x[basic[row_of[k]] - N] = 0.0


@helper(int64(MATRIX, int64, VECTOR, INDEX, INDEX, INDEX, INDEX, float64))
def exchange_support(T, n, start, basic, nonbasic, row_of, column_of, tolerance):
    """Bring the free unknowns and every v_k that is positive in `start` (N,) into the basis, for the equalities and
    their w_k: COMPLEMENTARY, or STUCK where the matrix of this basis is singular. Arrays as for `reduce`."""
    N = T.shape[0]
    _number(N, n, basic, nonbasic, row_of, column_of)
    rows = np.empty(N, np.int64)
    count = 0
    for i in range(N):
        if i < n or start[i] > 0.0:
            rows[count] = i
            count += 1
    columns = rows.copy()
    for left in range(count, 0, -1):
        _, p, q = _largest(T, rows, columns, left, tolerance)
        if p < 0:
            return STUCK
        exchange(T, basic, nonbasic, rows[p], columns[q])
        rows[p], columns[q] = rows[left - 1], columns[left - 1]
    for i in range(N):
        if basic[i] >= N + n:
            row_of[basic[i] - N - n] = i
        if n <= nonbasic[i] < N:
            column_of[nonbasic[i] - n] = i
    return COMPLEMENTARY


@kernel(int64(VECTOR, VECTOR, int64, float64))
def lemke_mixed(data, answer, max_pivots, tolerance):
    """Solve one MLCP in two arrays, for every array of a call costs what ten unknowns do.

    From the basis of the v of a start that are above IDLE, where there are any; from none where that matrix is
    singular or the pivots end elsewhere than in a solution. Returns pivots * CODES + outcome, pivots being Lemke's.

    Parameters
    ----------
    data : HEAD numbers, K (N, N), k (N,), row_unit (N,), unit (N,) and `workspace` more.
    answer : (N,) the start, or zeros; (u, v) is written there.
    """
    N, n = answer.size, np.int64(data[0])
    m = N - n
    v_unit, push, rank_tolerance, pivot_tolerance, tie_tolerance = data[1], data[2], data[3], data[4], data[5]
    at = HEAD
    K = data[at : at + N * N].reshape(N, N)
    at += N * N
    k, row_unit, unit = data[at : at + N], data[at + N : at + 2 * N], data[at + 2 * N : at + 3 * N]
    at += 3 * N
    T = data[at : at + N * (N + 1)].reshape(N, N + 1)
    at += N * (N + 1)
    x, of_u, of_v = data[at : at + N], data[at + N : at + 2 * N], data[at + 2 * N : at + 3 * N]
    at += 3 * N
    M, q, z = data[at : at + m * m].reshape(m, m), data[at + m * m : at + m * m + m], data[at + m * m + m :][:m]
    at += m * (m + 2)
    labels = data[at : at + 4 * N].view(np.int64).reshape(4, N)
    at += 4 * N
    basic, nonbasic, row_of, column_of = labels[0], labels[1], labels[2, :m], labels[3, :m]
    top = 0.0
    for i in range(n, N):
        top = max(top, answer[i] / unit[i])
    warm = top > 0.0  # zeros are what a start looks like where none is given
    for i in range(n, N):
        if answer[i] <= IDLE * top * unit[i]:
            answer[i] = 0.0
    pivots = 0
    while True:
        for i in range(N):
            for j in range(N):
                T[i, j] = K[i, j]
            T[i, N] = k[i]
        if warm:
            outcome = exchange_support(T, n, answer, basic, nonbasic, row_of, column_of, rank_tolerance)
        else:
            outcome = reduce(T, n, basic, nonbasic, row_of, column_of, rank_tolerance)
        if not warm or outcome == COMPLEMENTARY:
            remaining(T, row_of, column_of, M, q)
            if m <= WHOLE:
                tableau, reals = data[at : at + m * (m + 1)].reshape(m, m + 1), data[at + m * (m + 1) :][: 4 * (m + 1)]
                numbers = data[at + (m + 4) * (m + 1) :][: 4 * (2 * m + 1)].view(np.int64).reshape(4, 2 * m + 1)
                reals_2d = reals.reshape(4, m + 1)
                code = whole_tableau(M, q, z, tableau, reals_2d, numbers, max_pivots, pivot_tolerance, tie_tolerance)
            else:
                code = lemke(M, q, z, max_pivots, pivot_tolerance, tie_tolerance)
            pivots += code // CODES
            if outcome == COMPLEMENTARY:
                outcome = code % CODES
        if not warm or outcome == COMPLEMENTARY:
            recover(T, n, basic, nonbasic, row_of, column_of, z, x)
            error = error_with(K, k, n, row_unit, unit, v_unit, push, x, of_u, of_v)
            if error <= tolerance or not warm:
                break
        warm = False
    for i in range(N):
        answer[i] = unit[i] * x[i]
    return pivots * CODES + (RIGHT if error <= tolerance else outcome)


@kernel(int64(int64, int64))
def workspace(N, m):
    """Return numbers that `lemke_mixed` writes beside the answer."""
    return N * (N + 8) + m * (m + 2) + ((m + 4) * (m + 1) + 4 * (2 * m + 1) if m <= WHOLE else 0)
