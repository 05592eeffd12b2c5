"""The duality gap of the connected parts of a quadratic program, with the names of `qp_parts` and `qp_rows`."""

import numpy as np
from numba import boolean, float64, njit

from cpbench_solvers.kernels.array_types import COMPILED, DATA, VECTOR

NOISE = 8.0 * np.finfo(np.float64).eps
"""Share of the terms of a row that rounding may leave where they cancel."""
OWN, SMALL = 0.1, 1e-5  # a constraint is missed by at most 10 ε of its own terms, if these are SMALL of its part's


@njit(float64(float64, float64), **COMPILED)
def without(f, noise):
    """Return f nearer to 0 by `noise`."""
    return np.copysign(max(abs(f) - noise, 0.0), f)


@njit(float64(float64, float64, float64, float64, float64), **COMPILED)
def product(low, high, x, w, reach):
    """Return x w, with x counted from the bound to which w pushes, at most `reach`, and less by rounding."""
    bound = low if w > 0.0 else high
    room = x - bound if abs(bound) < np.inf else x  # without a bound on that side w should be 0, and x is what it costs
    return w * np.copysign(max(min(abs(room), reach) - NOISE * reach, 0.0), room) if room != 0.0 else 0.0


@njit(float64(boolean, float64, float64, float64, float64, float64, float64, float64), **COMPILED)
def own_miss(is_row, low, high, x, f, terms, unit, effect):
    """Return OWN of the share by which a constraint, or a bound that is not 0, is missed of its own terms."""
    if is_row:
        missed, size = max(-f, 0.0 if low > -np.inf else f), unit
    else:
        side, size = low if x < low else high if x > high else 0.0, effect
        missed, terms = abs(x - side), abs(x) + abs(side) if side != 0.0 else 0.0
    return OWN * missed / terms if terms * size > SMALL else 0.0


@njit(**COMPILED)
def gaps(program, x, f, sums, needed, known, unit, effect, products, objective, most):
    """Write the products x_i f_i, and of every part (count,) the terms of the objective and the most that the gap may
    be, ½zᵀQz where there are no prices; return what sides and prices make these."""
    n, c, low, high, part, D, kind = program[0], *program[4:9], program[10]
    count = objective.size
    quadratic, prices, straight, sides = np.zeros(count), np.zeros(count), np.zeros(count), np.zeros(count)
    side, price, given = np.zeros(count), np.zeros(count), np.zeros(count)
    for i in range(x.size):
        q, size = part[i], 1.0 / unit[i] if unit[i] > 0.0 else 0.0
        w = without(f[i], NOISE * max(sums[i] + abs(c[i]), size))  # otherwise a gap of pure rounding would be an error
        reach = 1.0 / effect[i] if effect[i] > 0.0 else 0.0
        products[i] = product(low[i], high[i], x[i], w, reach) if kind[q] > 0.0 else 0.0
        quadratic[q] += x[i] * (w - c[i])
        own = D[i] * abs(c[i]) if needed[i] > 0.0 else 0.0
        if i < n:
            prices[q] += x[i] * c[i]
            straight[q] += abs(x[i] * c[i])
            price[q] = max(price[q], own)
        else:
            sides[q] += abs(x[i] * c[i])
            side[q] = max(side[q], own)
    for q in range(count):
        half = 0.5 * quadratic[q]
        # ½zᵀQz alone where prices cancel it
        objective[q] = max(max(abs(half + prices[q]), abs(half)), min(straight[q], sides[q]))
        most[q] = abs(half) if straight[q] == 0.0 else np.inf
        z = max(side[q], price[q] if kind[q] == 2.0 else 0.0)
        given[q] = z * max(price[q], z if kind[q] == 2.0 else 0.0)
    return given


@njit(**COMPILED)
def row_products(program, f, sums, unit, products, gap):
    """Add the products of rows beside y to the gaps of their parts, those of a row that is given several times added up
    first: it is known by its value."""
    n, c, part = program[0], program[4], program[7]
    rows = np.flatnonzero(products[n:] != 0.0) + n
    value = np.empty(rows.size)
    for k in range(rows.size):
        i = rows[k]
        size = 1.0 / unit[i] if unit[i] > 0.0 else 0.0
        # rows that are given twice have the same value to rounding, and share a multiplier
        value[k] = without(abs(f[i]), NOISE * max(sums[i] + abs(c[i]), size))
    order, total = np.argsort(value, kind="mergesort"), np.zeros(gap.size)  # stable: the same sums on every machine
    k = 0
    while k < rows.size:
        last = k
        while last < rows.size and value[order[last]] == value[order[k]]:
            total[part[rows[order[last]]]] += products[rows[order[last]]]
            last += 1
        for at in range(k, last):
            q = part[rows[order[at]]]
            gap[q] += abs(total[q])
            total[q] = 0.0
        k = last


@njit(float64(DATA, DATA, DATA, DATA, VECTOR), **COMPILED)
def gap_errors(known, gap, given, alone, objective):
    """Return the largest error of a gap; `objective` becomes what the gap of each part is compared with.

    given : what sides and prices make the objective; ε² of that is 0. alone : the gap in the units of its part.
    """
    total = worst = 0.0
    for q in range(gap.size):
        size = max(objective[q], gap[q])
        error = gap[q] / size if gap[q] > 0.0 else 0.0
        of_zero = np.sqrt(size / given[q]) if size < given[q] else 1.0  # an objective near 0 has half of the digits
        if of_zero < error:
            error, objective[q] = of_zero, given[q]
        if known[q] > 0.0:
            worst, total = max(worst, error), total + objective[q]
    for q in range(gap.size):
        if known[q] == 0.0:
            worst = max(worst, min(alone[q], gap[q] / total) if total > 0.0 else alone[q])
            objective[q] = total
        objective[q] = max(objective[q], gap[q])
    return worst
