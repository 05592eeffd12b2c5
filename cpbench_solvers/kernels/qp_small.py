"""A small dense quadratic program from its data to its answer: proximal steps over the dual active set.

x⁺ = argmin ½xᵀHx + gᵀx + ½ε‖x − x⁰‖² over lower ≤ (x, Gx) ≤ upper, in the data scaled to size one, by `qp_dual` in the
coordinates v = Lᵀx, LLᵀ = H + εI. Where H is positive definite ε is 0 and there is one step; where less than
n√eps is left of a number on its diagonal, the least eigenvalue is about √eps or less: half of the digits of v would be
lost, and passes would undo each other. Proximal steps are ahead then.
"""

import numpy as np
from numba import njit, types

from cpbench_solvers.kernels.array_types import COMPILED
from cpbench_solvers.kernels.qp_dense import dot, equilibrate, judged_error
from cpbench_solvers.kernels.qp_dual import (
    FIRST_PART,
    INFEASIBLE,
    LIMIT,
    OPERATIONS,
    PART,
    PASSES,
    SOLVED,
    STATES,
    advance,
    begin,
    normalise,
)
from cpbench_solvers.kernels.qp_parts import program
from cpbench_solvers.kernels.qp_rows import exact, largest_error
from cpbench_solvers.kernels.qp_sparse import rows_of, stacked
from cpbench_solvers.kernels.vectors import put

NOT_CONVEX = 4
"""The outcome, beside those of `qp_dual`, where no factorization says that Q is positive semidefinite."""
SCALINGS = 4
SEMIDEFINITE = 4.0
"""Times n eps: what is added to a diagonal of ones before the factorization has to do, as in `matrices.is_psd`."""
LEAST = 0.1
"""The size of H counts as this share of that of g at least when ε is chosen: H may be 0."""
RAY, WINDOW, GAIN = 1e6, 20, 0.99
"""Proximal steps end where x has grown to this, and where the error has not fallen for a while."""
VECTOR = types.Array(types.float64, 1, "C", readonly=True)
MATRIX = types.Array(types.float64, 2, "C", readonly=True)
_OUT = types.float64[::1]
_OUT2 = types.float64[:, ::1]


@njit(types.float64(_OUT2, _OUT2, types.float64, types.boolean), **COMPILED)
def _cholesky(H, L, shift, unit):
    """Write the lower factor of H + shift·diag(H) (`unit`), or of H + shift·I, and return the least share that is left
    of a number on the diagonal; 0 at the first one of which nothing is. Where `unit`, a row with the diagonal entry 0
    must be 0, and stands for one of the identity."""
    least = 1.0
    for i in range(H.shape[0]):
        row = L[i]
        for j in range(i):
            row[j] = (H[i, j] - dot(row[:j], L[j, :j])) / L[j, j]
        if unit and H[i, i] == 0.0:
            for j in range(H.shape[0]):
                if H[i, j] != 0.0:
                    return 0.0
            row[i] = 1.0
            continue
        whole = H[i, i] + (shift * H[i, i] if unit else shift)
        pivot = whole - dot(row[:i], row[:i])
        if not pivot > 0.0:
            return 0.0
        least = min(least, pivot / whole)
        row[i] = np.sqrt(pivot)
    return least


@njit(types.void(_OUT2, _OUT, types.int64), **COMPILED)
def _forward(L, x, first):
    """Set x ← L⁻¹x, whose numbers before `first` are 0."""
    for i in range(first, x.size):
        x[i] = (x[i] - dot(L[i, first:i], x[first:i])) / L[i, i]


@njit(types.void(_OUT2, _OUT), **COMPILED)
def _backward(L, x):
    """Set x ← L⁻ᵀx."""
    for i in range(x.size - 1, -1, -1):
        value = x[i] / L[i, i]
        x[i] = value
        row = L[i]
        for j in range(i):
            x[j] -= row[j] * value


@njit(
    types.int64(
        *(MATRIX, VECTOR, MATRIX, VECTOR, MATRIX, VECTOR, VECTOR, VECTOR),
        *(types.float64, types.float64, types.float64, types.float64, types.int64, types.int64),
        *(_OUT, _OUT, _OUT, _OUT, _OUT, types.int64[::1]),
    ),
    **COMPILED,
)
def solve(
    Q, p, A, b, C, d, lb, ub, tolerance, psd, proximal, feasible, most, operations, z, lam, mu, nu, error, counts
):
    """Write z, λ, μ, ν and their judged error, by norms and, within the tolerance, by connected parts; return SOLVED
    where both are within it, else why not.

    Parameters
    ----------
    psd : the share of its diagonal that Q may lack to be semidefinite. proximal : ε relative to the size of H.
    feasible : tolerance of `qp_dual`. most : passes. operations : of `qp_dual`, soon after which it ends.
    error : (1,) of the best answer, which is written.
    counts : (4,) passes, steps, operations, whether the steps are proximal, and only approach the answer.
    """
    n, m, r = p.size, b.size, b.size + d.size
    H, G, D, E = np.empty((n, n)), np.empty((r, n)), np.ones(n), np.ones(r)
    for i in range(n):
        for j in range(n):
            H[i, j] = Q[i, j]
    for i in range(r):
        row = A[i] if i < m else C[i - m]
        for j in range(n):
            G[i, j] = row[j]
    equilibrate(H, G, D, E, SCALINGS)
    L, eps, epsilon = np.empty((n, n)), np.finfo(np.float64).eps, 0.0
    least, top, size = np.inf, 0.0, 0.0
    for i in range(n):
        least, size = min(least, H[i, i]), max(size, abs(D[i] * p[i]))
        for j in range(n):
            top = max(top, abs(H[i, j]))
    if not (least > 0.0 and _cholesky(H, L, 0.0, False) > n * np.sqrt(eps)):
        if not (least >= 0.0 and _cholesky(H, L, max(psd, SEMIDEFINITE * n * eps), True) > 0.0):
            return NOT_CONVEX
        epsilon = proximal * (max(top, LEAST * max(top, size)) or 1.0)
        if not _cholesky(H, L, epsilon, False) > 0.0:
            return NOT_CONVEX
        counts[3] = 1
    sides = 0
    for i in range(n + r):
        sides += i >= n or lb[i] > -np.inf or ub[i] < np.inf
    M, place = np.zeros((sides, n)), np.empty(sides, np.int64)
    lower, upper, norms = np.empty(sides), np.empty(sides), np.empty(sides)
    at = 0
    for i in range(n):
        if lb[i] > -np.inf or ub[i] < np.inf:
            M[at, i], place[at] = 1.0, i
            lower[at], upper[at] = lb[i] / D[i], ub[i] / D[i]
            _forward(L, M[at], i)
            at += 1
    for i in range(r):
        put(M[at], G[i])
        place[at] = n + i
        lower[at] = (b[i] if i < m else d[i - m]) * E[i]
        upper[at] = np.inf if i < m else lower[at]
        _forward(L, M[at], 0)
        at += 1
    normalise(M, norms)
    for k in range(sides):
        if norms[k] > 0.0:
            lower[k] /= norms[k]
            upper[k] /= norms[k]
        else:
            norms[k] = 1.0
    v0, v, y, g, x, best = np.empty(n), np.empty(n), np.zeros(sides), np.empty(n), np.zeros(n), np.empty(2 * n + r)
    R, W, where, side = np.empty((n, n)), np.empty(n, np.int64), np.empty(sides, np.int64), np.empty(sides, np.int64)
    state, gained, before = np.zeros(STATES, np.int64), np.empty(2), np.empty(sides)
    work, judge = np.empty(3 * n + sides), np.empty(2 * n)
    for i in range(n):
        g[i] = D[i] * p[i]
    error[0] = np.inf
    outcome, since = SOLVED, 0
    while True:
        counts[1] += 1
        for i in range(n):
            v0[i] = epsilon * x[i] - g[i]
        _forward(L, v0, 0)
        passes = state[PASSES]
        state[:] = 0
        state[PASSES], state[PART] = passes, FIRST_PART
        gained[0] = -1.0
        begin(M, v0, v, y, where, state)
        how = gained, before, work, most, operations - counts[2], feasible
        outcome = advance(M, lower, upper, v0, v, y, R, W, where, side, state, *how)
        counts[0] = state[PASSES]
        counts[2] += state[OPERATIONS]
        if outcome == INFEASIBLE:
            return INFEASIBLE
        put(x, v)
        _backward(L, x)
        top = 0.0
        for i in range(n):
            z[i], nu[i] = min(max(D[i] * x[i], lb[i]), ub[i]), 0.0
            top = max(top, abs(x[i]))
        lam[:] = 0.0
        mu[:] = 0.0
        for k in range(sides):
            i, value = place[k], y[k] / norms[k]
            if value == 0.0:
                continue
            if i < n:
                nu[i], z[i] = value / D[i], lb[i] if value > 0.0 else ub[i]
            elif i < n + m:
                lam[i - n] = value * E[i - n]
            else:
                mu[i - n - m] = value * E[i - n]
        now = judged_error(Q, p, A, b, C, d, lb, ub, z, lam, mu, nu, judge)
        if now <= tolerance and not exact(Q, p, A, b, C, d, lb, ub, z, lam, mu, nu):
            conditions = program(rows_of(Q), stacked(rows_of(A), rows_of(C)), p, np.concatenate((b, d)), m, lb, ub)
            now = max(now, largest_error(conditions, np.concatenate((z, lam, mu)), nu))
        if now < GAIN * error[0]:
            since = counts[1]
        if now < error[0]:
            error[0] = now
            put(best[:n], z)
            put(best[n : 2 * n], nu)
            put(best[2 * n : 2 * n + m], lam)
            put(best[2 * n + m :], mu)
        if now <= tolerance:
            return SOLVED
        if outcome != SOLVED or epsilon == 0.0 or not top < RAY or counts[1] - since > WINDOW:
            break
    if error[0] < np.inf:
        put(z, best[:n])
        put(nu, best[n : 2 * n])
        put(lam, best[2 * n : 2 * n + m])
        put(mu, best[2 * n + m :])
    return LIMIT if outcome == SOLVED else outcome


READY = True
