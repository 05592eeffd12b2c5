"""The linear systems [[H + diag(w), Gᵀ], [G, −diag(θ)]], factored with +δ and −δ on the diagonal, then refined.

Sparse, or dense by the Schur complement of the rows with θ > 0: then S is [[H + diag(w) + AᵀA/θ, Cᵀ], [C, −diag(θ)]]
with the rows C that have θ = 0 or nearly so. H, G : (row pointers, columns, numbers).
"""

import numpy as np

from cpbench.foundation.kernels import boolean, float64, helper, int32, int64, kernel, tuple_of, void
from cpbench_solvers.kernels.qp_dense import dot
from cpbench_solvers.kernels.qp_ldl import (
    CSR,
    INT,
    OUT,
    OUT2,
    ROWS,
    backward,
    dense_factor,
    dense_solve,
    factor,
    forward,
)
from cpbench_solvers.kernels.vectors import put, unsigned

_COLUMNS = int32[::1]
OWN = _COLUMNS, _COLUMNS, OUT
SYSTEM = tuple_of(
    *(INT, INT, _COLUMNS, _COLUMNS, OUT, OUT, INT, INT), *(ROWS, OUT, OUT, OUT2), *(INT, INT, OUT2, OUT, OUT)
)
"""head : columns before the dense rest, or −1 for a dense system. order, indptr, indices, data, diagonal, parent,
starts, rows, L, D, S : as in `qp_ldl`. rest, equal : rows with θ > 0, and with θ = 0 or nearly so. A : (n, ·),
the columns of the rest, dense. by : their 1/(θ + δ). work : (5 (n + r),)."""
STRIP = 96
"""Columns of AᵀΘ⁻¹A that one product of matrices makes, without most of what is above the diagonal."""
REFINEMENTS = 4
ACCURATE = 1e-9
"""What is left of a right-hand side, relative to it, that needs no further refinement."""


@helper(void(CSR, OUT, OUT))
def times(M, x, y):
    """Set y ← Mx."""
    M = unsigned(M)
    for i in range(y.size):
        begin, end = M[0][i], M[0][i + 1]
        if end - begin == x.size:  # a full row needs no indices
            y[i] = dot(M[2][begin:end], x)
            continue
        total = 0.0
        for q in range(begin, end):
            total += M[2][q] * x[M[1][q]]
        y[i] = total


@helper(void(CSR, float64, OUT, OUT))
def add_transposed(M, by, x, y):
    """Set y ← y + by Mᵀx."""
    M = unsigned(M)
    for i in range(x.size):
        value = by * x[i]
        begin, end = M[0][i], M[0][i + 1]
        if value != 0.0 and end - begin == y.size:
            row = M[2][begin:end]
            for j in range(y.size):
                y[j] += row[j] * value
        elif value != 0.0:
            for q in range(begin, end):
                y[M[1][q]] += M[2][q] * value


@kernel(tuple_of(*OWN)(CSR, int64))
def filled(M, n):
    """Return a matrix of n columns with the zeros of its rows that are at least half full: products need no indices
    there."""
    r, (start, column, value) = M[0].size - 1, unsigned(M)
    indptr, full = np.zeros(r + 1, np.int32), np.empty(r, np.bool_)
    for i in range(r):
        full[i] = 2 * (start[i + 1] - start[i]) >= n
        indptr[i + 1] = indptr[i] + (n if full[i] else start[i + 1] - start[i])
    indices, data = np.empty(indptr[r], np.int32), np.empty(indptr[r])
    for i in range(r):
        at = indptr[i]
        for j in range(n if full[i] else 0):
            indices[at + j], data[at + j] = j, 0.0
        for q in range(start[i], start[i + 1]):
            to = at + (column[q] if full[i] else q - start[i])
            indices[to], data[to] = column[q], value[q]
    return indptr, indices, data


@kernel(void(CSR, INT, OUT2))
def columns_of(M, rows, A):
    """Write some rows of M as columns of A, which is 0."""
    start, column, value = unsigned(M)
    for k in range(rows.size):
        for q in range(start[rows[k]], start[rows[k] + 1]):
            A[column[q], k] = value[q]


@helper(float64(OUT))
def largest(x):
    """Return the ∞-norm; NaN where a number is."""
    top = 0.0
    for value in x:
        top = np.maximum(top, abs(value))  # max would lose a NaN
    return top


@kernel(boolean(CSR, CSR, SYSTEM, OUT, OUT, float64))
def factor_system(H, G, system, w, theta, delta):
    """Factor; return False where it breaks down."""
    head, order, indptr, indices, data, diagonal, parent, starts, rows, L, D, S, rest, equal, A, by, work = system
    n, H = w.size, unsigned(H)
    if head[0] < 0:
        if rest.size:
            scaled = np.empty(A.shape)
            for i in range(rest.size):
                by[i] = 1.0 / (theta[rest[i]] + delta)
            roots = np.sqrt(by)
            for j in range(n):
                for i in range(rest.size):
                    scaled[j, i] = roots[i] * A[j, i]
            for left in range(0, n, STRIP):  # the lower triangle
                right = min(left + STRIP, n)
                product = np.dot(scaled[left:], scaled[left:right].T)
                for i in range(left, n):
                    for j in range(left, min(i + 1, right)):
                        S[i, j] = product[i - left, j - left]
        else:
            S[:] = 0.0
        own = work[: n + equal.size]  # what the diagonal was, by which a pivot of the wrong sign is known
        for i in range(n):
            S[i, i] += w[i] + delta
            own[i] = w[i] + delta
            begin, end = H[0][i], H[0][i + 1]
            if end - begin == n:
                row, entries = S[i], H[2][begin:end]
                for j in range(i + 1):  # only the lower triangle is read
                    row[j] += entries[j]
                own[i] += entries[i]
                continue
            for q in range(begin, end):
                if H[1][q] <= i:
                    S[i, H[1][q]] += H[2][q]
                if H[1][q] == i:
                    own[i] += H[2][q]
        for k in range(equal.size):
            row = S[n + k]
            for j in range(n + k):
                row[j] = 0.0
            row[n + k] = own[n + k] = -theta[equal[k]] - delta  # negative: quasi-definite, so that no pivot is needed
            for q in range(G[0][equal[k]], G[0][equal[k] + 1]):
                row[G[1][q]] += G[2][q]
        return dense_factor(S, own)
    shifted = work[: order.size]
    for k in range(order.size):
        i = order[k]
        shifted[k] = diagonal[k] + (w[i] + delta if i < n else -theta[i - n] - delta)
    return factor(indptr, indices, data, shifted, parent, starts, rows, L, D, S, head[0]) and (
        not S.size or dense_factor(S, shifted[head[0] :])
    )


@kernel(void(SYSTEM, OUT, OUT, OUT, OUT))
def apply(system, a, b, x, v):
    """Set x, v ← the solution for a, b of the system as it was factored."""
    head, order, starts, rows, L, D, S = system[0], system[1], system[7], system[8], system[9], system[10], system[11]
    rest, equal, A, by, work = system[12], system[13], system[14], system[15], system[16]
    n, N = a.size, a.size + b.size
    y = work[:N]
    if head[0] < 0:
        y = work[: n + equal.size]
        put(y[:n], a)
        some = work[n + equal.size : N]  # as many as the rest
        for i in range(rest.size):
            some[i] = by[i] * b[rest[i]]
        for j in range(n):
            y[j] += dot(A[j], some)
        for k in range(equal.size):
            y[n + k] = b[equal[k]]
        dense_solve(S, y)
        put(x, y[:n])
        for k in range(equal.size):
            v[equal[k]] = y[n + k]
        some[:] = 0.0
        for j in range(n):
            row, value = A[j], x[j]
            for i in range(rest.size):
                some[i] += row[i] * value
        for i in range(rest.size):
            v[rest[i]] = by[i] * (some[i] - b[rest[i]])
        return
    for k in range(N):
        i = order[k]
        y[k] = a[i] if i < n else b[i - n]
    forward(starts, rows, L, y, head[0])
    if S.size:
        dense_solve(S, y[head[0] :])
    backward(starts, rows, L, D, y, head[0])
    for k in range(N):
        i = order[k]
        if i < n:
            x[i] = y[k]
        else:
            v[i - n] = y[k]


@helper(float64(CSR, CSR, OUT, OUT, OUT, OUT, OUT, OUT, OUT, OUT))
def _left(H, G, w, theta, a, b, x, v, c, d):
    """Set c, d ← what (x, v) leaves of the right-hand side (a, b), and return its ∞-norm."""
    times(H, x, c)
    add_transposed(G, 1.0, v, c)
    times(G, x, d)
    top = 0.0
    for i in range(a.size):
        c[i] = a[i] - c[i] - w[i] * x[i]
        top = np.maximum(top, abs(c[i]))
    for i in range(b.size):
        d[i] = b[i] - d[i] + theta[i] * v[i]
        top = np.maximum(top, abs(d[i]))
    return top


@kernel(float64(CSR, CSR, SYSTEM, OUT, OUT, OUT, OUT, OUT, OUT))
def solve_system(H, G, system, w, theta, a, b, x, v):
    """Set x, v ← the solution for a, b, refined while that helps; return what is left, relative to these."""
    n, N = a.size, a.size + b.size
    work = system[16]
    c, d, dx, dv = work[N : N + n], work[N + n : 2 * N], work[2 * N : 2 * N + n], work[2 * N + n : 3 * N]
    e, f = work[3 * N : 3 * N + n], work[3 * N + n : 4 * N]
    size = max(largest(a), largest(b))
    apply(system, a, b, x, v)
    error = _left(H, G, w, theta, a, b, x, v, c, d)
    for _ in range(REFINEMENTS):
        if not error > ACCURATE * size:
            break
        apply(system, c, d, dx, dv)
        for i in range(n):
            dx[i] += x[i]
        for i in range(b.size):
            dv[i] += v[i]
        now = _left(H, G, w, theta, a, b, dx, dv, e, f)
        if not now < error:  # rounding is reached: a further step could only lose
            break
        put(x, dx)
        put(v, dv)
        put(c, e)
        put(d, f)
        error = now
    return error / size if size > 0.0 else error
