"""A dense quadratic program: the error of an answer, and its data scaled to size one.

The error is `QP.residuals(...).error`, but absolute numbers count only where the data have no size: in small units they
would hide any miss. Without prices it is sides that are reached that give Qz its size, and terms that cancel have it.
"""

import numpy as np

from cpbench.foundation.kernels import boolean, float64, helper, int64, kernel, read_only, tuple_of, void

_VECTOR = read_only(float64)
_MATRIX = read_only(float64, 2)
_OUT = float64[::1]
_OUT2 = float64[:, ::1]
NEAR = 0.5
"""Share of a side's size: a value that is nearer to it has its size from it."""


@helper(float64(_VECTOR, _VECTOR), fast=frozenset({"reassoc", "contract"}))
def dot(x, y):
    """Return xᵀy, summed in vector lanes."""
    total = 0.0
    for i in range(x.size):
        total += x[i] * y[i]
    return total


@kernel(float64(_VECTOR, _VECTOR), fast=frozenset({"reassoc", "contract"}))
def sizes(x, y):
    """Return |x|ᵀ|y|."""
    total = 0.0
    for i in range(x.size):
        total += abs(x[i] * y[i])
    return total


@helper(float64(float64, float64, float64))
def measured(absolute, scale, data):
    """Return a value over its scale, or over 1 where that is more and `data`, the share of the problem in the scale,
    is 0; ∞ for what is no number."""
    scale = max(scale, min(data, 1.0))
    value = absolute / scale if scale > 1.0 or data > 0.0 else absolute
    return value if value >= 0.0 else np.inf  # also NaN


@helper(float64(*(float64,) * 11))
def largest(stationarity, force, price, primal, sides, side, dual, multiplier, gap, value, curvature):
    """Return the error of the parts, each with its scale; price, side and curvature are max|p|, the largest side and
    the largest entry of Q."""
    energy = price * price / curvature if curvature > 0.0 else 0.0  # what a price gains where it meets a curvature
    return max(
        measured(stationarity, max(force, price), price),
        measured(primal, max(sides, side), side),
        measured(dual, multiplier, price),
        measured(gap, value, energy),
    )


@helper(tuple_of(*[float64] * 4)(*(float64,) * 4))
def of_bounds(low, high, x, price):
    """Return of an unknown: how far it is outside its bounds, the size of these, how far its multiplier has a sign that
    no bound allows, and their part of the dual objective."""
    outside = wrong = size = term = 0.0
    if low > -np.inf:
        # np.maximum keeps NaN, max may lose it
        outside, size, term = np.maximum(outside, low - x), abs(low), low * max(price, 0.0)
    else:
        wrong = np.maximum(wrong, price)
    if high < np.inf:
        outside, size, term = np.maximum(outside, x - high), max(size, abs(high)), term - high * max(-price, 0.0)
    else:
        wrong = np.maximum(wrong, -price)
    return outside, size, wrong, term


@helper(boolean(float64, float64))
def reached(side, value):
    """Return whether a value has its size from a side that is not 0: it is nearer than by half of it."""
    return side != 0.0 and abs(side) < np.inf and abs(value - side) <= NEAR * abs(side)


@helper(boolean(_VECTOR, _VECTOR, _VECTOR))
def at_bounds(lb, ub, z):
    """Return whether an unknown has its size from a bound."""
    at = False
    for i in range(z.size):
        at = at or reached(lb[i], z[i]) or reached(ub[i], z[i])
    return at


@helper(float64(_MATRIX, _MATRIX, _VECTOR, _MATRIX, _VECTOR, _VECTOR, _VECTOR, _VECTOR))
def _terms(Q, A, b, C, d, lb, ub, z):
    """Return the largest Σ_j |Q_ij z_j| where a side that is not 0 is reached, else 0."""
    sided, size = at_bounds(lb, ub, z), 0.0
    for i in range(b.size):
        sided = sided or reached(b[i], dot(A[i], z))
    for i in range(d.size):
        sided = sided or reached(d[i], dot(C[i], z))
    if sided:
        for i in range(z.size):
            size = max(size, sizes(Q[i], z))
    return size


@kernel(
    float64(
        *(_MATRIX, _VECTOR, _MATRIX, _VECTOR, _MATRIX, _VECTOR, _VECTOR, _VECTOR),
        *(_VECTOR, _VECTOR, _VECTOR, _VECTOR, _OUT),
    )
)
def judged_error(Q, p, A, b, C, d, lb, ub, z, lam, mu, nu, work):
    """Return the error of an answer. work : (2n,)."""
    n = p.size
    At, Ct = work[:n], work[n : 2 * n]
    At[:] = 0.0
    Ct[:] = 0.0
    primal = dual = primal_scale = dual_scale = constraints = side = summed = 0.0
    for i in range(b.size):
        a, value, y = A[i], dot(A[i], z), lam[i]
        primal, side = np.maximum(primal, b[i] - value), max(side, abs(b[i]))
        # the terms are needed for violated rows only
        primal_scale, summed = max(primal_scale, abs(value)), max(summed, 0.0 if value >= b[i] else sizes(a, z))
        dual = np.maximum(dual, -y)
        dual_scale = max(dual_scale, abs(y))
        constraints += b[i] * y
        if y != 0.0:
            for j in range(n):
                At[j] += a[j] * y
    for i in range(d.size):
        c, value, y = C[i], dot(C[i], z), mu[i]
        primal, side = np.maximum(primal, abs(value - d[i])), max(side, abs(d[i]))
        primal_scale, summed = max(primal_scale, abs(value)), max(summed, 0.0 if value == d[i] else sizes(c, z))
        dual_scale = max(dual_scale, abs(y))
        constraints += d[i] * y
        if y != 0.0:  # most multipliers are 0, and a row costs n operations
            for j in range(n):
                Ct[j] += c[j] * y
    stationarity = scale = zQz = pz = price = curvature = 0.0
    for i in range(n):
        Qz = dot(Q[i], z)
        stationarity = np.maximum(stationarity, abs(Qz + p[i] - At[i] - Ct[i] - nu[i]))
        scale = max(scale, abs(Qz), abs(At[i]), abs(Ct[i]), abs(nu[i]))
        price, curvature = max(price, abs(p[i])), max(curvature, Q[i, i])
        zQz += z[i] * Qz
        pz += z[i] * p[i]
        dual_scale = max(dual_scale, abs(nu[i]))
        outside, bound, wrong, term = of_bounds(lb[i], ub[i], z[i], nu[i])
        primal, side = np.maximum(primal, outside), max(side, bound)
        dual = np.maximum(dual, wrong)
        constraints += term
    # zᵀQz + pᵀz = bᵀλ + dᵀμ + bounds at a solution
    gap, value = abs(zQz + pz - constraints), max(abs(zQz), abs(pz), abs(constraints))
    sides = max(primal_scale, min(summed, 1.0))
    error = largest(stationarity, scale, price, primal, sides, side, dual, dual_scale, gap, value, curvature)
    if price == 0.0 and side > 0.0 and stationarity > 0.0:  # no price to compare forces with
        terms = _terms(Q, A, b, C, d, lb, ub, z)
        error = max(error, stationarity / max(terms, scale) if terms > 0.0 else 0.0)
    return error


@kernel(void(_OUT2, _OUT2, _OUT, _OUT, int64))
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
                tops[j] = max(tops[j], a)  # columns of [[H, Gᵀ], [G, 0]]: H and G together
            sides[i] = side
        for i in range(n):
            # powers of two change no digit of the data
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
