"""A dense quadratic program: its judged error, and its data scaled to size one."""

import numpy as np
from numba import njit, types

from cpbench.solvers.kernels.array_types import COMPILED

_VECTOR = types.Array(types.float64, 1, "C", readonly=True)
_MATRIX = types.Array(types.float64, 2, "C", readonly=True)
_OUT = types.float64[::1]
_OUT2 = types.float64[:, ::1]


@njit(types.float64(_VECTOR, _VECTOR), **COMPILED, fastmath={"reassoc", "contract"})
def dot(x, y):
    """Return xᵀy, summed in vector lanes."""
    total = 0.0
    for i in range(x.size):
        total += x[i] * y[i]
    return total


@njit(types.float64(types.float64, types.float64), **COMPILED)
def judged(absolute, scale):
    """Return the smaller of the absolute and the relative value, ∞ for what is no number."""
    value = absolute / scale if scale > 1.0 else absolute
    return value if value >= 0.0 else np.inf


@njit(types.UniTuple(types.float64, 4)(*(types.float64,) * 4), **COMPILED)
def of_bounds(low, high, x, price):
    """Return of an unknown: how far it is outside its bounds, the size of these, how far its multiplier has a sign that
    no bound allows, and their part of the dual objective."""
    outside = wrong = size = term = 0.0
    if low > -np.inf:
        outside, size, term = np.maximum(outside, low - x), abs(low), low * max(price, 0.0)
    else:
        wrong = np.maximum(wrong, price)
    if high < np.inf:
        outside, size, term = np.maximum(outside, x - high), max(size, abs(high)), term - high * max(-price, 0.0)
    else:
        wrong = np.maximum(wrong, -price)
    return outside, size, wrong, term


@njit(
    types.float64(
        *(_MATRIX, _VECTOR, _MATRIX, _VECTOR, _MATRIX, _VECTOR, _VECTOR, _VECTOR),
        *(_VECTOR, _VECTOR, _VECTOR, _VECTOR, _OUT),
    ),
    **COMPILED,
)
def judged_error(Q, p, A, b, C, d, lb, ub, z, lam, mu, nu, work):
    """Return `QP.residuals(...).error`. work : (2n,)."""
    n = p.size
    At, Ct = work[:n], work[n : 2 * n]
    At[:] = 0.0
    Ct[:] = 0.0
    primal = dual = primal_scale = dual_scale = constraints = 0.0
    for i in range(b.size):
        a, value, y = A[i], dot(A[i], z), lam[i]
        primal = np.maximum(primal, b[i] - value)
        primal_scale = max(primal_scale, abs(value), abs(b[i]))
        dual = np.maximum(dual, -y)
        dual_scale = max(dual_scale, abs(y))
        constraints += b[i] * y
        if y != 0.0:
            for j in range(n):
                At[j] += a[j] * y
    for i in range(d.size):
        c, value, y = C[i], dot(C[i], z), mu[i]
        primal = np.maximum(primal, abs(value - d[i]))
        primal_scale = max(primal_scale, abs(value), abs(d[i]))
        dual_scale = max(dual_scale, abs(y))
        constraints += d[i] * y
        if y != 0.0:
            for j in range(n):
                Ct[j] += c[j] * y
    stationarity = scale = zQz = pz = 0.0
    for i in range(n):
        Qz = dot(Q[i], z)
        stationarity = np.maximum(stationarity, abs(Qz + p[i] - At[i] - Ct[i] - nu[i]))
        scale = max(scale, abs(Qz), abs(At[i]), abs(Ct[i]), abs(p[i]), abs(nu[i]))
        zQz += z[i] * Qz
        pz += z[i] * p[i]
        dual_scale = max(dual_scale, abs(nu[i]))
        outside, bound, wrong, term = of_bounds(lb[i], ub[i], z[i], nu[i])
        primal, primal_scale = np.maximum(primal, outside), max(primal_scale, bound)
        dual = np.maximum(dual, wrong)
        constraints += term
    gap = judged(abs(zQz + pz - constraints), max(abs(zQz), abs(pz), abs(constraints)))
    return max(judged(stationarity, scale), judged(primal, primal_scale), judged(dual, dual_scale), gap)


@njit(types.void(_OUT2, _OUT2, _OUT, _OUT, types.int64), **COMPILED)
def equilibrate(H, G, column, row, passes):
    """Scale H ← DHD, G ← EGD with D, E powers of two that bring every row and column of [[H, Gᵀ], [G, 0]] near max norm
    1.

    Ruiz 2001. column, row : D, E, ones on entry; those of a zero row stay as they are.
    """
    n, r = H.shape[0], G.shape[0]
    tops, sides = np.empty(n), np.empty(r)
    for _ in range(passes):
        for i in range(n):
            top = 0.0
            for j in range(n):
                top = max(top, abs(H[i, j]))
            tops[i] = top
        for i in range(r):
            side = 0.0
            for j in range(n):
                a = abs(G[i, j])
                side = max(side, a)
                tops[j] = max(tops[j], a)
            sides[i] = side
        for i in range(n):
            tops[i] = 2.0 ** np.rint(-0.5 * np.log2(tops[i])) if tops[i] > 0.0 else 1.0
            column[i] *= tops[i]
        for i in range(n):
            for j in range(n):
                H[i, j] *= tops[i] * tops[j]
        for i in range(r):
            side = 2.0 ** np.rint(-0.5 * np.log2(sides[i])) if sides[i] > 0.0 else 1.0
            row[i] *= side
            for j in range(n):
                G[i, j] *= side * tops[j]


READY = True
