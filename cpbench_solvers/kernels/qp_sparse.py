"""A quadratic program with sparse matrices: the error of an answer, its data scaled to size one.

Matrices are (row pointers, columns, numbers).
"""

import numpy as np

from cpbench.foundation.kernels import boolean, float64, helper, int32, int64, kernel, read_only, tuple_of, void
from cpbench_solvers.kernels.qp_dense import at_bounds, largest, of_bounds, reached
from cpbench_solvers.kernels.qp_ldl import CSR, DATA, OUT
from cpbench_solvers.kernels.vectors import unsigned

_DENSE = read_only(float64, 2)
_OWN = tuple_of(int32[::1], int32[::1], float64[::1])


@kernel(_OWN(_DENSE))
def rows_of(M):
    """Return the entries of a dense matrix that are not 0."""
    count = 0
    for i in range(M.shape[0]):
        for j in range(M.shape[1]):
            count += M[i, j] != 0.0
    indptr = np.zeros(M.shape[0] + 1, np.int32)
    indices, data = np.empty(count, np.int32), np.empty(count)
    at = 0
    for i in range(M.shape[0]):
        for j in range(M.shape[1]):
            if M[i, j] != 0.0:
                indices[at], data[at] = j, M[i, j]
                at += 1
        indptr[i + 1] = at
    return indptr, indices, data


@kernel(_OWN(CSR, CSR))
def stacked(A, C):
    """Return the rows of A and then of C."""
    m, k = A[0].size - 1, C[0].size - 1
    nA, nC = A[0][m], C[0][k]
    indptr = np.empty(m + k + 1, np.int32)
    indices, data = np.empty(nA + nC, np.int32), np.empty(nA + nC)
    for i in range(m):
        indptr[i] = A[0][i]
    for i in range(k + 1):
        indptr[m + i] = nA + C[0][i]
    for q in range(nA):
        indices[q], data[q] = A[1][q], A[2][q]
    for q in range(nC):
        indices[nA + q], data[nA + q] = C[1][q], C[2][q]
    return indptr, indices, data


@helper(boolean(OUT))
def _roots(size):
    """Replace sizes by powers of two near size^-½, 1 where the size is 0; return whether one is not 1."""
    other = False
    for i in range(size.size):
        size[i] = 2.0 ** np.rint(-0.5 * np.log2(size[i])) if size[i] > 0.0 else 1.0
        other = other or size[i] != 1.0
    return other


@kernel(void(_OWN, _OWN, OUT, OUT, int64))
def equilibrate(H, G, column, row, passes):
    """Scale as `qp_dense.equilibrate` does. column, row : D, E, ones on entry."""
    n, r, H, G = column.size, row.size, unsigned(H), unsigned(G)
    tops, sides = np.empty(n), np.empty(r)
    for _ in range(passes):
        for i in range(n):
            tops[i] = 0.0
            for q in range(H[0][i], H[0][i + 1]):
                tops[i] = max(tops[i], abs(H[2][q]))
        for i in range(r):
            sides[i] = 0.0
            for q in range(G[0][i], G[0][i + 1]):
                size = abs(G[2][q])
                sides[i] = max(sides[i], size)
                tops[G[1][q]] = max(tops[G[1][q]], size)  # columns of G share the scale of H's
        if not (_roots(tops) | _roots(sides)):  # both have to be replaced
            break
        for i in range(n):
            column[i] *= tops[i]
            for q in range(H[0][i], H[0][i + 1]):
                H[2][q] *= tops[i] * tops[H[1][q]]
        for i in range(r):
            row[i] *= sides[i]
            for q in range(G[0][i], G[0][i + 1]):
                G[2][q] *= sides[i] * tops[G[1][q]]


@helper(boolean(CSR, DATA, DATA))
def _at_sides(A, b, z):
    """Return whether a row of A has its size from its side."""
    A = unsigned(A)
    for i in range(b.size):
        value = 0.0
        for q in range(A[0][i], A[0][i + 1]):
            value += A[2][q] * z[A[1][q]]
        if reached(b[i], value):
            return True
    return False


@helper(float64(CSR, CSR, DATA, CSR, DATA, DATA, DATA, DATA))
def _terms(Q, A, b, C, d, lb, ub, z):
    """Return the largest Σ_j |Q_ij z_j| where a side that is not 0 is reached, else 0."""
    most = 0.0
    if at_bounds(lb, ub, z) or _at_sides(A, b, z) or _at_sides(C, d, z):
        for i in range(z.size):
            size = 0.0
            for q in range(Q[0][i], Q[0][i + 1]):
                size += abs(Q[2][q] * z[Q[1][q]])
            most = max(most, size)
    return most


@kernel(float64(*(CSR, DATA, CSR, DATA, CSR, DATA, DATA, DATA), *(DATA, DATA, DATA, DATA)))
def judged_error(Q, p, A, b, C, d, lb, ub, z, lam, mu, nu):
    """Return the error of an answer, as `qp_dense` has it; infinite for one that is no number."""
    n, signed, Q, A, C = p.size, (Q, A, C), unsigned(Q), unsigned(A), unsigned(C)
    At, Ct = np.zeros(n), np.zeros(n)
    primal = dual = primal_scale = dual_scale = constraints = side = summed = 0.0
    for i in range(b.size):
        value = size = 0.0
        for q in range(A[0][i], A[0][i + 1]):
            term = A[2][q] * z[A[1][q]]
            value += term
            size += abs(term)
            At[A[1][q]] += A[2][q] * lam[i]
        primal, side = np.maximum(primal, b[i] - value), max(side, abs(b[i]))
        primal_scale, summed = max(primal_scale, abs(value)), max(summed, size)
        dual = np.maximum(dual, -lam[i])
        dual_scale = max(dual_scale, abs(lam[i]))
        constraints += b[i] * lam[i]
    for i in range(d.size):
        value = size = 0.0
        for q in range(C[0][i], C[0][i + 1]):
            term = C[2][q] * z[C[1][q]]
            value += term
            size += abs(term)
            Ct[C[1][q]] += C[2][q] * mu[i]
        primal, side = np.maximum(primal, abs(value - d[i])), max(side, abs(d[i]))
        primal_scale, summed = max(primal_scale, abs(value)), max(summed, size)
        dual_scale = max(dual_scale, abs(mu[i]))
        constraints += d[i] * mu[i]
    stationarity = scale = zQz = pz = price = curvature = 0.0
    for i in range(n):
        Qz = 0.0
        for q in range(Q[0][i], Q[0][i + 1]):
            Qz += Q[2][q] * z[Q[1][q]]
            curvature = max(curvature, abs(Q[2][q]))  # of a semidefinite Q the largest entry is on the diagonal
        stationarity = np.maximum(stationarity, abs(Qz + p[i] - At[i] - Ct[i] - nu[i]))
        scale, price = max(scale, abs(Qz), abs(At[i]), abs(Ct[i]), abs(nu[i])), max(price, abs(p[i]))
        zQz += z[i] * Qz
        pz += z[i] * p[i]
        dual_scale = max(dual_scale, abs(nu[i]))
        outside, bound, wrong, term = of_bounds(lb[i], ub[i], z[i], nu[i])
        primal, side = np.maximum(primal, outside), max(side, bound)
        dual = np.maximum(dual, wrong)
        constraints += term
    gap, value = abs(zQz + pz - constraints), max(abs(zQz), abs(pz), abs(constraints))
    sides = max(primal_scale, min(summed, 1.0))
    error = largest(stationarity, scale, price, primal, sides, side, dual, dual_scale, gap, value, curvature)
    if price == 0.0 and side > 0.0 and stationarity > 0.0:
        terms = _terms(signed[0], signed[1], b, signed[2], d, lb, ub, z)
        error = max(error, stationarity / max(terms, scale) if terms > 0.0 else 0.0)
    return error
