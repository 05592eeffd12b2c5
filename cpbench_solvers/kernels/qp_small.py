"""A small dense quadratic program from its data to its answer: proximal steps over the dual active set.

x⁺ = argmin ½xᵀHx + gᵀx + ½ε‖x − x⁰‖² over lower ≤ (x, Gx) ≤ upper, in the data scaled to size one, by `qp_dual` in the
coordinates v = Lᵀx, LLᵀ = H + εI. Where H is positive definite ε is 0 and there is one step; where less than
n√eps is left of a number on its diagonal, the least eigenvalue is about √eps or less: half of the digits of v would be
lost, and passes would undo each other. Proximal steps are ahead then.
"""

import numpy as np

from cpbench.foundation.kernels import float64, helper, int64, kernel, read_only, void
from cpbench_solvers.kernels.dense_cholesky import BY_BLOCKS, backward, cholesky, forward, forward_by_blocks
from cpbench_solvers.kernels.linear_error import exact_program, largest_error
from cpbench_solvers.kernels.linear_rows import linear
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
from cpbench_solvers.kernels.qp_sparse import rows_of, stacked
from cpbench_solvers.kernels.vectors import put

NOT_CONVEX, CROWDED = 4, 5
"""Outcomes, beside those of `qp_dual`: no factorization says that Q is positive semidefinite; too many sides exclude
the minimum without them."""
SCALINGS = 4
SEMIDEFINITE = 4.0
"""Times n eps: what is added to a diagonal of ones before the factorization has to do, as in `matrices.is_psd`."""
LEAST = 0.1
"""The size of H counts as this share of that of g at least when ε is chosen: H may be 0."""
RAY, WINDOW, GAIN = 1e6, 20, 0.99
"""Proximal steps end where x has grown to this, and where the error has not fallen for a while."""
VECTOR = read_only(float64)
MATRIX = read_only(float64, 2)
_OUT = float64[::1]
_OUT2 = float64[:, ::1]
INDEX = int64[::1]
PROGRAM = (MATRIX, VECTOR, MATRIX, VECTOR, MATRIX, VECTOR, VECTOR, VECTOR)
"""Q, p, A, b, C, d, lb, ub."""


@helper(float64(_OUT2, _OUT, float64, float64, _OUT2))
def _factor(H, g, psd, proximal, L):
    """Write L of H + εI and return ε, which is 0 where H is positive definite; −1 where it is not semidefinite.

    proximal : ε relative to the size of H, or of g where that is much larger.
    """
    n, eps, least, top, size = g.size, np.finfo(np.float64).eps, np.inf, 0.0, 0.0
    for i in range(n):
        least, size = min(least, H[i, i]), max(size, abs(g[i]))
        for j in range(n):
            top = max(top, abs(H[i, j]))
    if least > 0.0 and cholesky(H, L, 0.0, False) > n * np.sqrt(eps):
        return 0.0
    if not (least >= 0.0 and cholesky(H, L, max(psd, SEMIDEFINITE * n * eps), True) > 0.0):
        return -1.0
    epsilon = proximal * (max(top, LEAST * max(top, size)) or 1.0)
    return epsilon if cholesky(H, L, epsilon, False) > 0.0 else -1.0


@helper(int64(_OUT2, VECTOR, VECTOR, VECTOR, _OUT2, _OUT, _OUT, _OUT))
def _excluding(G, b, lb, ub, L, g, D, E):
    """Return how many bounds and inequalities exclude x = −(LLᵀ)⁻¹g, the minimum without them and the equations."""
    n, m, count = g.size, b.size, 0
    x = -g
    forward(L, x, 0)
    backward(L, x)
    for i in range(n):
        count += D[i] * x[i] < lb[i] or D[i] * x[i] > ub[i]
    for i in range(m):
        count += dot(G[i], x) < b[i] * E[i]
    return count


@helper(void(_OUT2, VECTOR, VECTOR, VECTOR, VECTOR, _OUT2, _OUT, _OUT, *(_OUT2, INDEX, _OUT, _OUT, _OUT)))
def _write_sides(G, b, d, lb, ub, L, D, E, M, place, lower, upper, norms):
    """Write bounds and rows as lower ≤ Mv ≤ upper, each row of M of norm 1, with the s of each in `place`."""
    n, m, at = D.size, b.size, 0
    for i in range(n):
        if lb[i] > -np.inf or ub[i] < np.inf:
            M[at, i], place[at] = 1.0, i
            lower[at], upper[at] = lb[i] / D[i], ub[i] / D[i]
            at += 1
    for i in range(E.size):
        put(M[at], G[i])
        place[at] = n + i
        lower[at] = (b[i] if i < m else d[i - m]) * E[i]
        upper[at] = np.inf if i < m else lower[at]
        at += 1
    if n >= BY_BLOCKS and at:
        columns = np.ascontiguousarray(M.T)
        forward_by_blocks(L, columns)
        for k in range(at):
            put(M[k], columns[:, k])
    else:
        for k in range(at):
            forward(L, M[k], place[k] if place[k] < n else 0)  # e_i has zeros before i, and L⁻¹e_i too
    normalise(M, norms)
    for k in range(at):
        if norms[k] > 0.0:
            lower[k] /= norms[k]
            upper[k] /= norms[k]
        else:
            norms[k] = 1.0  # a row of zeros: nothing divides by it


@helper(float64(*(_OUT, _OUT, INDEX, _OUT, _OUT, _OUT, VECTOR, VECTOR), *(_OUT, _OUT, _OUT, _OUT)))
def _write_answer(x, y, place, norms, D, E, lb, ub, z, lam, mu, nu):
    """Write z, λ, μ and ν of x and the multipliers y of its sides; return the largest size of an x."""
    n, m, top = x.size, lam.size, 0.0
    for i in range(n):
        z[i], nu[i] = min(max(D[i] * x[i], lb[i]), ub[i]), 0.0  # rounding of D x may leave the bounds
        top = max(top, abs(x[i]))
    lam[:] = 0.0
    mu[:] = 0.0
    for k in range(y.size):
        i, value = place[k], y[k] / norms[k]
        if value == 0.0:
            continue
        if i < n:
            # complementary exactly, as a verdict on every pair wants it
            nu[i], z[i] = value / D[i], lb[i] if value > 0.0 else ub[i]
        elif i < n + m:
            lam[i - n] = value * E[i - n]
        else:
            mu[i - n - m] = value * E[i - n]
    return top


@helper(float64(*PROGRAM, float64, _OUT, _OUT, _OUT, _OUT, _OUT))
def _error_of(Q, p, A, b, C, d, lb, ub, tolerance, z, lam, mu, nu, judge):
    """Return the error of an answer by norms and, where that is within the tolerance, the verdict's."""
    error = judged_error(Q, p, A, b, C, d, lb, ub, z, lam, mu, nu, judge)
    # the verdict's takes as long as a solve: last, and only if needed
    if error <= tolerance and not exact_program(Q, p, A, b, C, d, lb, ub, z, lam, mu, nu):
        rows = linear(rows_of(Q), stacked(rows_of(A), rows_of(C)), p, np.concatenate((b, d)), b.size, lb, ub, True)
        error = max(error, largest_error(rows, np.concatenate((z, lam, mu)), nu))
    return error


@helper(void(_OUT, _OUT, _OUT, _OUT, _OUT))
def _keep(best, z, nu, lam, mu):
    """Write an answer, its parts one after the other."""
    n, m = z.size, lam.size
    put(best[:n], z)
    put(best[n : 2 * n], nu)
    put(best[2 * n : 2 * n + m], lam)
    put(best[2 * n + m :], mu)


@kernel(
    int64(
        *PROGRAM,
        *(float64, float64, float64, float64, float64, int64, int64),
        *(_OUT, _OUT, _OUT, _OUT, _OUT, INDEX),
    )
)
def solve(
    Q, p, A, b, C, d, lb, ub, tolerance, psd, proximal, feasible, crowd, most, operations, z, lam, mu, nu, error, counts
):
    """Write z, λ, μ, ν and their judged error, by norms and, within the tolerance, the verdict's; return SOLVED
    where both are within it, else why not.

    Parameters
    ----------
    psd : the share of its diagonal that Q may lack to be semidefinite. proximal : ε relative to the size of H.
    feasible : tolerance of `qp_dual`. crowd : of n, so many sides may exclude the minimum without them. most :
        passes. operations : of `qp_dual`, soon after which it ends.
    error : (1,) of the best answer, which is written.
    counts : (4,) passes, steps, operations, whether the steps are proximal, and only approach the answer.
    """
    n, m, r = p.size, b.size, b.size + d.size
    H, G, D, E = np.empty((n, n)), np.empty((r, n)), np.ones(n), np.ones(r)
    top = 0.0
    for i in range(n):
        top = max(top, abs(Q[i, i]))
    # the unit of the objective first: by D alone it would become one of the unknowns
    c = 2.0 ** -np.rint(np.log2(top)) if 0.0 < top < np.inf else 1.0
    for i in range(n):
        for j in range(n):
            H[i, j] = c * Q[i, j]
    for i in range(r):
        row = A[i] if i < m else C[i - m]
        for j in range(n):
            G[i, j] = row[j]
    equilibrate(H, G, D, E, SCALINGS)
    L, g = np.empty((n, n)), np.empty(n)
    for i in range(n):
        g[i] = D[i] * (c * p[i])
    epsilon = _factor(H, g, psd, proximal, L)
    if epsilon < 0.0:
        return NOT_CONVEX
    counts[3] = epsilon > 0.0
    if crowd < np.inf and _excluding(G, b, lb, ub, L, g, D, E) > crowd * n:
        return CROWDED
    sides = 0
    for i in range(n + r):
        sides += i >= n or lb[i] > -np.inf or ub[i] < np.inf
    M, place, norms = np.zeros((sides, n)), np.empty(sides, np.int64), np.empty(sides)
    lower, upper = np.empty(sides), np.empty(sides)
    _write_sides(G, b, d, lb, ub, L, D, E, M, place, lower, upper, norms)
    norms *= c  # multipliers come in the unit of the objective
    v0, v, y, x, best = np.empty(n), np.empty(n), np.zeros(sides), np.zeros(n), np.empty(2 * n + r)
    R, W, where, side = np.empty((n, n)), np.empty(n, np.int64), np.empty(sides, np.int64), np.empty(sides, np.int64)
    state, gained, before = np.zeros(STATES, np.int64), np.empty(2), np.empty(sides)
    work, judge = np.empty(3 * n + sides), np.empty(2 * n)
    error[0] = np.inf
    outcome, since = SOLVED, 0
    while True:
        counts[1] += 1
        for i in range(n):
            v0[i] = epsilon * x[i] - g[i]
        forward(L, v0, 0)
        passes = state[PASSES]
        state[:] = 0
        state[PASSES], state[PART] = passes, FIRST_PART  # passes count over all proximal steps
        gained[0] = -1.0
        begin(M, v0, v, y, where, state)  # warm: the multipliers of the step before
        how = gained, before, work, most, operations - counts[2], feasible
        outcome = advance(M, lower, upper, v0, v, y, R, W, where, side, state, *how)
        counts[0] = state[PASSES]
        counts[2] += state[OPERATIONS]
        if outcome == INFEASIBLE:
            return INFEASIBLE
        put(x, v)
        backward(L, x)
        top = _write_answer(x, y, place, norms, D, E, lb, ub, z, lam, mu, nu)
        now = _error_of(Q, p, A, b, C, d, lb, ub, tolerance, z, lam, mu, nu, judge)
        if now < GAIN * error[0]:
            since = counts[1]
        if now < error[0]:
            error[0] = now
            _keep(best, z, nu, lam, mu)
        if now <= tolerance:
            return SOLVED
        # one step is exact where ε is 0: another one changes nothing
        if outcome != SOLVED or epsilon == 0.0 or not top < RAY or counts[1] - since > WINDOW:
            break
    if error[0] < np.inf:
        put(z, best[:n])  # not the last, which may be worse
        put(nu, best[n : 2 * n])
        put(lam, best[2 * n : 2 * n + m])
        put(mu, best[2 * n + m :])
    return LIMIT if outcome == SOLVED else outcome
