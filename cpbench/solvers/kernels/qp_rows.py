"""The largest error of a row of a quadratic program, and its duality gap: both hide in norms over all.

Rows are f = Qz + p − Gᵀy beside z and g = Gz − h beside y, G the rows of A and then of C, h their sides. D makes the
terms D_i K_ij D_j of [[Q, Gᵀ], [G, 0]] about 1; times D, the rows f have one size, and the rows g another. A size is
the largest sum of terms, or constant, of a row, and at least that of the unknowns, max_i |z_i|/D_i. The constants of
idle rows give none: prices beside a bound that they push towards, sides that are not reached. One that is large would
hide what is wrong in the others. An unknown has its unit from its largest effect on a row. Where nothing gives a
size, z is 0 and compared with 1, and every row with its own terms.

The gap is |Σ z_i f_i + Σ y_j g_j|, with z counted from the bound to which f pushes, at most its size; products of
unknowns without that bound count each by itself. It is compared with the terms of the objective,

    max(|½zᵀQz + pᵀz|, ½|zᵀQz|, min(Σ|p_i z_i|, Σ|h_j y_j|)),

without the constants of idle rows. Rounding of terms that cancel, 8 eps Σ|terms|, is taken off f and g first.
"""

import numpy as np
from numba import boolean, float64, int64, njit

from cpbench.solvers.kernels.array_types import COMPILED
from cpbench.solvers.kernels.qp_dense import at_bounds
from cpbench.solvers.kernels.qp_ldl import CSR, DATA

PASSES, ENOUGH = 20, 0.02
"""Passes of the equilibration at most, and the change of log₂ D at which they end."""
HEARD = 0.1
"""Share of an idle constant that the other terms of its row must reach for it to count."""
NOISE = 8.0 * np.finfo(np.float64).eps
"""Share of the terms of a row that rounding may leave where they cancel."""


@njit(float64[::1](DATA), **COMPILED)
def _logarithms(x):
    """Return log₂|x|, 0 for 0."""
    return np.array([np.log2(abs(number)) if number != 0.0 else 0.0 for number in x])


@njit(float64[::1](CSR, CSR), **COMPILED)
def equilibration(Q, G):
    """Return D (n + r,): the logarithms of terms add up to 0 in every row, those of small terms weighed by these."""
    n, r = Q[0].size - 1, G[0].size - 1
    D, log, level, weight = np.ones(n + r), np.zeros(n + r), np.empty(n + r), np.empty(n + r)
    of_Q, of_G = _logarithms(Q[2]), _logarithms(G[2])
    for _ in range(PASSES):
        level[:] = 0.0
        weight[:] = 0.0
        for i in range(n):
            for q in range(Q[0][i], Q[0][i + 1]):
                j = Q[1][q]
                share = min(D[i] * abs(Q[2][q]) * D[j], 1.0)
                level[i] += share * (log[i] + of_Q[q] + log[j])
                weight[i] += share
                if i == j:
                    weight[i] += share
        for i in range(r):
            for q in range(G[0][i], G[0][i + 1]):
                j = G[1][q]
                share = min(D[n + i] * abs(G[2][q]) * D[j], 1.0)
                term = share * (log[n + i] + of_G[q] + log[j])
                level[n + i] += term
                level[j] += term
                weight[n + i] += share
                weight[j] += share
        most = 0.0
        for i in range(n + r):
            if weight[i] > 0.0:
                change = 0.5 * level[i] / weight[i]
                most = max(most, abs(change))
                log[i] -= change
                D[i] = 2.0 ** log[i]
        if most < ENOUGH:
            break
    return D


@njit(boolean(float64, float64, float64, float64), **COMPILED)
def _idle(low, high, x, f):
    """Return whether the row f pushes its unknown towards its nearer bound."""
    below, above = abs(x - low), abs(high - x)  # infinite where there is no bound
    if f > 0.0:
        return low > -np.inf and below <= above
    return f < 0.0 and high < np.inf and above <= below


@njit(float64(float64, float64), **COMPILED)
def _without_noise(f, noise):
    """Return f nearer to 0 by `noise`."""
    return np.copysign(max(abs(f) - noise, 0.0), f)


@njit(
    float64(*(DATA, DATA, int64, DATA, DATA), *(DATA, DATA, DATA, DATA, DATA, DATA), *(DATA, DATA, boolean)), **COMPILED
)
def _gap(p, h, m, lb, ub, z, y, f, g, terms, feeds, units, effect, sized):
    """Return the gap over the terms of the objective; where nothing gives a size, the sum of |z_i f_i| in units."""
    gap = alone = quadratic = price = prices = sides = absolute = 0.0
    for i in range(p.size):
        w = _without_noise(f[i], NOISE * (terms[i] + abs(p[i])))
        bound = lb[i] if w > 0.0 else ub[i]
        far = z[i] - bound if abs(bound) < np.inf else z[i]
        product = w * (min(max(far, -1.0 / effect[i]), 1.0 / effect[i]) if effect[i] > 0.0 else far)
        absolute += abs(product) * units[i]
        if abs(bound) < np.inf:
            gap += product
        else:
            alone += abs(product)
        quadratic += z[i] * (w - p[i])
        if terms[i] > HEARD * abs(p[i]) or not _idle(lb[i], ub[i], z[i], f[i]):
            price += p[i] * z[i]
            prices += abs(p[i] * z[i])
    for i in range(h.size):
        w = _without_noise(g[i], NOISE * (feeds[i] + abs(h[i])))
        gap += y[i] * w
        absolute += abs(y[i] * w) * units[p.size + i]
        quadratic += y[i] * (w + h[i])
        if i >= m or not g[i] > 0.0 or feeds[i] > HEARD * abs(h[i]):
            sides += abs(h[i] * y[i])
    if not sized:
        return absolute
    gap = abs(gap) + alone
    objective = max(abs(0.5 * quadratic + price), 0.5 * abs(quadratic), min(prices, sides))
    return gap / max(objective, gap) if gap > 0.0 else 0.0


@njit(float64[::1](CSR, DATA, DATA), **COMPILED)
def _own_units(M, constants, z):
    """Return 1 over the larger of the constant of each row and its terms, z taken as 1 at least."""
    units = np.empty(constants.size)
    for i in range(constants.size):
        size = 0.0
        for q in range(M[0][i], M[0][i + 1]):
            size += abs(M[2][q]) * max(abs(z[M[1][q]]), 1.0)
        size = max(size, abs(constants[i]))
        units[i] = 1.0 / size if size > 0.0 else 1.0
    return units


@njit(float64(*(CSR, DATA, CSR, DATA, int64, DATA, DATA), *(DATA, DATA, DATA, DATA)), **COMPILED)
def largest_error(Q, p, G, h, m, lb, ub, D, z, y, nu):
    """Return the largest error of a row, or that of the gap; 0 where that is no number.

    Parameters
    ----------
    m : the first rows of G are inequalities. D : of `equilibration`. nu : the multipliers of bounds, compared with f.
    """
    n, r = p.size, h.size
    f, g, terms, feeds = p.copy(), np.empty(r), np.zeros(n), np.empty(r)
    for i in range(n):
        for q in range(Q[0][i], Q[0][i + 1]):
            term = Q[2][q] * z[Q[1][q]]
            f[i] += term
            terms[i] += abs(term)
    side = 0.0
    sided = at_bounds(lb, ub, z)
    for i in range(r):
        g[i], feeds[i] = -h[i], 0.0
        for q in range(G[0][i], G[0][i + 1]):
            j = G[1][q]
            term = G[2][q] * z[j]
            g[i] += term
            feeds[i] += abs(term)
            f[j] -= G[2][q] * y[i]
            terms[j] += abs(G[2][q] * y[i])
        counts = i >= m or not g[i] > 0.0 or feeds[i] > HEARD * abs(h[i])
        sided = sided or (counts and h[i] != 0.0)
        side = max(side, D[n + i] * (max(feeds[i], abs(h[i])) if counts else feeds[i]))
    reach = force = price = asked = 0.0
    for i in range(n):
        idle, constant = _idle(lb[i], ub[i], z[i], f[i]), D[i] * abs(p[i])
        reach, force = max(reach, abs(z[i]) / D[i]), max(force, D[i] * terms[i])
        if not idle:
            price = max(price, constant)
        if not idle or terms[i] > HEARD * abs(p[i]):
            asked = max(asked, constant)
    sized = sided or asked > 0.0
    if sized:
        reach = reach if sided else max(reach, asked)
        force = max(force, price, reach if Q[2].size > 0 else 0.0)
        side = max(side, reach)
        units = D.copy()
        units[:n] /= force if force > 0.0 else 1.0
        units[n:] /= side if side > 0.0 else 1.0
    else:
        units = np.concatenate((_own_units(Q, p, z), _own_units(G, h, z)))
    effect, error = np.zeros(n), 0.0
    for i in range(n):
        for q in range(Q[0][i], Q[0][i + 1]):
            effect[Q[1][q]] = max(effect[Q[1][q]], abs(Q[2][q]) * units[i])
    for i in range(r):
        unit, most = units[n + i], 0.0
        for q in range(G[0][i], G[0][i + 1]):
            j = G[1][q]
            effect[j] = max(effect[j], abs(G[2][q]) * unit)
            most = max(most, abs(G[2][q]) * units[j])
        error = max(error, abs(g[i]) * unit if i >= m else max(-g[i] * unit, -y[i] * most))
    if not sized:
        effect[:] = 1.0
    for i in range(n):
        w = f[i] * units[i]
        error = max(error, abs(f[i] - nu[i]) * units[i] / max(1.0, abs(w)))
        error = max(error, (lb[i] - z[i]) * effect[i] if lb[i] > -np.inf else w)
        error = max(error, (z[i] - ub[i]) * effect[i] if ub[i] < np.inf else -w)
    return max(error, _gap(p, h, m, lb, ub, z, y, f, g, terms, feeds, units, effect, sized))


READY = True
