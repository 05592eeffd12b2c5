"""The verdict's error of an answer to a linear problem in a box: `cpbench.verification.linear`, compiled.

`docs/methods/verdict.md` has the definition with its reasons; names are those of `linear_rows`. Sizes of a group are
its largest rows and unknowns, in units, those of multipliers apart. Rows and unknowns are compared with them,
constraints with a share of their own terms, too; what is left is the gap over the objective.
"""

import numpy as np

from cpbench.foundation.kernels import DATA, DATA_2D, VECTOR, boolean, float64, helper, int64, kernel, void
from cpbench_solvers.kernels.linear_rows import LINEAR
from cpbench_solvers.kernels.qp_ldl import CSR

NOISE = 8.0 * np.finfo(np.float64).eps
"""Share of the terms of a row that rounding may leave where they cancel."""
OWN, SMALL, BALANCED, NEAR, FAR_BELOW = 0.1, 1e-5, 0.1, 0.5, 2.0**-40
"""Those of the verdict: constraints by their own terms, and from which share of all on these count; idle constants;
unknowns at a bound; what stands for 0."""
SIDES, PRICES, CHEAPEST, LEAST, REACH, GRADIENT, FEEDS, UNKNOWNS, MULTIPLIERS = range(9)
"""Sizes of a group, in units: the largest constant of a constraint or unknown at a bound; the largest and the least
constant of the gradient; the least side; how large sides make z, or prices where the objective is curved; rows beside z
and beside multipliers; z and multipliers."""
CURVED, BARE, AT_0, AIMLESS, ABSOLUTE, CONSTRAINED = range(6)
"""What is known of a group: z is in the gradient; only the least constant is a size; z may be 0; there is no
objective; the data give no size; it has multipliers."""
_KNOWN, _SIZE = boolean[:, ::1], float64[:, ::1]


@helper(boolean(float64, float64, float64, float64))
def _is_idle(low, high, x, f):
    """Return whether the row f pushes its unknown towards its nearer bound."""
    below, above = abs(x - low), abs(high - x)  # infinite where there is no bound
    if f > 0.0:
        return low > -np.inf and below <= above
    return f < 0.0 and high < np.inf and above <= below


@helper(boolean(float64, float64, float64))
def _is_anchored(low, high, x):
    """Return whether an unknown is at a bound that is not 0, or beyond."""
    at_low = low != 0.0 and low > -np.inf and (x <= low or abs(x - low) <= NEAR * abs(low))
    return at_low or (high != 0.0 and high < np.inf and (x >= high or abs(x - high) <= NEAR * abs(high)))


@helper(void(LINEAR, VECTOR, VECTOR, VECTOR, VECTOR))
def _rows(problem, x, f, sizes, sums):
    """Write the rows, the sizes of the unknowns, and the sums of the sizes of the terms of the rows."""
    n, start, column, value, c, low, high = problem[:7]
    start, column = start.view(np.uint64), column.view(np.uint64)
    for i in range(x.size):
        if i >= n and low[i] == high[i]:
            x[i] = 0.0  # of a row without a side
        sizes[i] = max(abs(x[i]), abs(min(max(x[i], low[i]), high[i])))
    for i in range(x.size):
        f[i], sums[i] = c[i], 0.0
        for k in range(start[i], start[i + 1]):
            f[i] += value[k] * x[column[k]]
            sums[i] += abs(value[k]) * sizes[column[k]]
        if i >= n and low[i] == high[i]:
            f[i] = 0.0


@helper(void(LINEAR, DATA, DATA, DATA, DATA, VECTOR, _KNOWN, _SIZE))
def _needed(problem, x, f, sizes, sums, needed, known, size):
    """Write |D c| of every row as far as it gives a size, what is known of the groups, and what holds their unknowns
    where they are: constants that are not idle, and bounds."""
    start, column, c, low, high, group, z, D, C = *problem[1:3], *problem[4:11]
    most, idle = np.zeros((2, known.shape[1])), np.zeros(x.size, np.bool_)
    for i in range(x.size):
        kind, g, needed[i] = 0 if z[i] else 1, group[i], D[i] * abs(c[i])
        # the constant of a row that is far from deciding anything
        idle[i] = _is_idle(low[i], high[i], x[i], f[i]) and D[i] * sums[i] <= BALANCED * needed[i]
        if not idle[i]:
            most[kind, g] = max(most[kind, g], needed[i])
        known[CONSTRAINED, g] |= not z[i]
        for k in range(start[i], start[i + 1]):
            known[CURVED, g] |= z[i] and z[column[k]]
        if z[i] and _is_anchored(low[i], high[i], x[i]):
            size[SIDES, g] = max(size[SIDES, g], sizes[i] / C[i])
    for g in range(known.shape[1]):
        known[AIMLESS, g] = problem[11] and known[CONSTRAINED, g] and not known[CURVED, g]
        if known[CURVED, g]:
            most[:, g] = max(most[0, g], most[1, g])
    for i in range(x.size):
        kind, g = 0 if z[i] else 1, group[i]
        if needed[i] <= FAR_BELOW * most[kind, g]:
            needed[i] = 0.0  # far below others it stands for 0
        if z[i] and needed[i] > 0.0:
            known[AIMLESS, g] = False
    most[:] = 0.0
    for i in range(x.size):
        if not idle[i]:
            kind, g = 0 if z[i] else 1, group[i]
            most[kind, g] = max(most[kind, g], needed[i])
    for g in range(known.shape[1]):
        size[SIDES, g] = max(size[SIDES, g], most[1, g])
        known[BARE, g] = size[SIDES, g] == 0.0 and not (known[CURVED, g] and most[0, g] > 0.0)
        known[AT_0, g] = size[SIDES, g] == 0.0 and (known[CONSTRAINED, g] or known[BARE, g])
    for i in range(x.size):
        if idle[i] and most[0 if z[i] else 1, group[i]] > 0.0:
            needed[i] = 0.0  # an idle constant is a size where there is no other


@helper(float64(float64, float64))
def _least(one, other):
    """Return the lesser one of two sizes, 0 standing for none."""
    return max(one, other) if one == 0.0 or other == 0.0 else min(one, other)


@helper(void(LINEAR, DATA, DATA, DATA, _KNOWN, _SIZE))
def _sizes(problem, sizes, sums, needed, known, size):
    """Write the sizes of the groups."""
    low, high, group, z, D, C = problem[5:11]
    beside = np.zeros(known.shape[1])
    for i in range(sizes.size):
        g, reach, row = group[i], sizes[i] / C[i], max(D[i] * sums[i], needed[i])
        if z[i]:
            size[PRICES, g], size[CHEAPEST, g] = max(size[PRICES, g], needed[i]), _least(size[CHEAPEST, g], needed[i])
            size[UNKNOWNS, g], size[GRADIENT, g] = max(size[UNKNOWNS, g], reach), max(size[GRADIENT, g], row)
            lower, upper = abs(low[i]) if low[i] > -np.inf else 0.0, abs(high[i]) if high[i] < np.inf else 0.0
            size[LEAST, g] = _least(size[LEAST, g], max(lower, upper) / C[i])
        else:
            beside[g], size[LEAST, g] = max(beside[g], needed[i]), _least(size[LEAST, g], needed[i])
            size[MULTIPLIERS, g], size[FEEDS, g] = max(size[MULTIPLIERS, g], reach), max(size[FEEDS, g], row)
    for g in range(known.shape[1]):
        if size[SIDES, g] == 0.0:
            size[SIDES, g] = beside[g]
        if known[BARE, g]:  # as where 0 is the solution: the least constant is a size
            size[SIDES, g], size[PRICES, g] = size[LEAST, g], size[CHEAPEST, g]
        known[ABSOLUTE, g] = size[SIDES, g] == 0.0 and size[PRICES, g] == 0.0
        known[ABSOLUTE, g] |= known[AIMLESS, g] and not problem[12]
        size[REACH, g] = max(size[SIDES, g], size[PRICES, g] if known[CURVED, g] else 0.0)
        if known[AT_0, g]:
            price = size[CHEAPEST, g] if known[CURVED, g] else 0.0
            size[UNKNOWNS, g] = max(size[UNKNOWNS, g], size[SIDES, g], price)
        if size[UNKNOWNS, g] == 0.0 and not problem[11]:
            size[UNKNOWNS, g] = size[REACH, g]  # 0 is not near its bounds
        size[MULTIPLIERS, g] = max(size[MULTIPLIERS, g], size[GRADIENT, g])
        size[FEEDS, g] = max(size[FEEDS, g], size[UNKNOWNS, g])


@helper(void(LINEAR, _KNOWN, _SIZE, VECTOR, VECTOR))
def _units(problem, known, size, x_unit, f_unit):
    """Write 1 over the sizes of unknowns and of rows."""
    group, z, D, C = problem[7:11]
    for i in range(x_unit.size):
        g = group[i]
        own, row = (size[UNKNOWNS, g], size[GRADIENT, g]) if z[i] else (size[MULTIPLIERS, g], size[FEEDS, g])
        x_unit[i], f_unit[i] = 1.0 / (C[i] * own) if own > 0.0 else 0.0, D[i] / row if row > 0.0 else 0.0
        if known[ABSOLUTE, g]:
            x_unit[i] = f_unit[i] = 1.0
        elif known[AIMLESS, g]:  # without an objective any multipliers are a certificate
            x_unit[i], f_unit[i] = x_unit[i] if z[i] else 0.0, 0.0 if z[i] else f_unit[i]


@helper(float64(float64, float64, float64, float64, float64, float64))
def _distance(low, high, x, f, x_unit, f_unit):
    """Return the larger one of the distances of x from its box and of f from where it must be, in units."""
    row = f * f_unit  # without a bound nothing may push towards it
    below = (low - x) * x_unit if low > -np.inf else row
    above = (x - high) * x_unit if high < np.inf else -row
    return max(below, above, 0.0)


@helper(float64(float64, float64, float64, float64, float64, float64))
def _defect(low, high, x, f, x_unit, f_unit):
    """Return |x̂ − P(x̂ − f̂)|, in units."""
    row = f * f_unit
    below = (x - low) * x_unit if low > -np.inf else np.inf
    above = (x - high) * x_unit if high < np.inf else -np.inf
    return abs(max(min(row, below), above))


@helper(float64(LINEAR, DATA, DATA, DATA, DATA, DATA, DATA, DATA, _KNOWN, _SIZE))
def _distances(problem, x, f, sums, needed, x_unit, f_unit, nu, known, size):
    """Return the largest distance of an unknown and a row from where they must be."""
    low, high, group, z, D = problem[5:10]
    worst = 0.0
    for i in range(x.size):
        g, by_row, by_bound = group[i], f_unit[i], x_unit[i]
        terms = sums[i] + needed[i] / D[i]
        # a constraint, or a bound other than 0, is missed by at most 10 ε of its own terms
        if not (z[i] and known[CONSTRAINED, g]) and terms * f_unit[i] > SMALL:
            by_row = max(by_row, OWN / terms)
        side = low[i] if x[i] < low[i] else high[i] if x[i] > high[i] else 0.0
        if z[i] and side != 0.0 and (abs(x[i]) + abs(side)) * x_unit[i] > SMALL:
            by_bound = max(by_bound, OWN / (abs(x[i]) + abs(side)))
        if problem[11]:
            error = _distance(low[i], high[i], x[i], f[i], by_bound, by_row)
        else:  # without an objective that is right, a pair of two small numbers is off by the lesser
            error = _defect(low[i], high[i], x[i], f[i], by_bound, by_row)
        if i < nu.size:  # the force of a bound has the digits of its own size
            error = max(error, abs(f[i] - nu[i]) * f_unit[i] / max(1.0, abs(f[i]) * f_unit[i]))
        grown = 0.0
        if size[REACH, g] > 0.0 and not known[ABSOLUTE, g]:
            # unknowns that cancel may be as large as one likes, and hide by that no more than √ε of the data
            by_data = D[i] / size[REACH, g]
            if not problem[11]:
                grown = _defect(low[i], high[i], x[i], f[i], x_unit[i], by_data)
            elif not z[i]:
                grown = _distance(low[i], high[i], x[i], f[i], 0.0, by_data)
        grown = min(grown, 1.0) ** 2
        if problem[11] and known[CURVED, g] and size[PRICES, g] == 0.0:
            # without prices a gradient whose terms are all below ε of what sides make of it is 0
            share = size[GRADIENT, g] / size[SIDES, g] if size[GRADIENT, g] < size[SIDES, g] else 1.0
            primal = (by_bound, 0.0) if z[i] else (0.0, by_row)
            error = max(_distance(low[i], high[i], x[i], f[i], *primal), min(error, share))
        worst = max(worst, error, grown)
    return worst


@helper(float64(LINEAR, DATA, DATA, DATA, DATA, DATA, DATA, _KNOWN, _SIZE))
def _gap(problem, x, f, sizes, sums, x_unit, f_unit, known, size):
    """Return the largest gap of a group over its objective; 0 of what is no program."""
    if not problem[11]:
        return 0.0
    c, low, high, group, z, C = *problem[4:9], problem[10]
    sums_of, count, worst = np.zeros((5, known.shape[1])), known.shape[1], 0.0
    gap, quadratic, straight, most, terms = sums_of[0], sums_of[1], sums_of[2], sums_of[3], sums_of[4]
    for i in range(x.size):
        g = group[i]
        weight = 1.0 if known[ABSOLUTE, g] or not known[AIMLESS, g] else 0.0
        far = 1.0 / x_unit[i] if x_unit[i] > 0.0 else 0.0
        side = max(abs(low[i]) if low[i] > -np.inf else 0.0, abs(high[i]) if high[i] < np.inf else 0.0)
        far = max(far, C[i] * size[REACH, g] if z[i] else side)  # an answer of 0 is not near its bounds
        if z[i]:
            most[g] = max(most[g], 1.0 / (x_unit[i] * C[i]) if x_unit[i] > 0.0 else 0.0)
        bound = low[i] if f[i] > 0.0 else high[i]
        room = abs(x[i] - bound) if abs(bound) < np.inf else abs(x[i])
        gap[g] += weight * abs(f[i]) * (room if known[ABSOLUTE, g] else min(room, far))
        linear = weight * x[i] * c[i]
        quadratic[g] += weight * x[i] * f[i] - linear
        terms[g] += weight * sizes[i] * (sums[i] + abs(c[i]))
        if not known[CONSTRAINED, g]:  # products of rows and constants have the same unknowns, whatever cancels
            straight[g] += abs(linear)
        elif z[i]:
            straight[g] += linear
    for g in range(count):
        square, reach = 0.5 * abs(quadratic[g]), size[REACH, g]
        objective = abs(0.5 * quadratic[g] + straight[g]) if known[CONSTRAINED, g] else straight[g]
        whole = max(objective, square, gap[g])
        error = gap[g] / whole if gap[g] > 0.0 else 0.0
        # an objective far below what the data make of it is 0: below ε of that by the least price, or ε² by squares
        by_square = reach * reach if known[CURVED, g] else 0.0
        made, compared = by_square, gap[g]
        if size[PRICES, g] > 0.0:
            made, compared = size[CHEAPEST, g] * min(reach, most[g]), whole
        share = compared / made if compared < made else 1.0
        square = max(square - NOISE * terms[g], 0.0)  # the root of rounding would be 1e-8
        of_square = square / by_square if square < by_square else (1.0 if by_square > 0.0 else 0.0)
        error = min(error, max(share, np.sqrt(of_square)))
        worst = max(worst, gap[g] if known[ABSOLUTE, g] else error)
    return worst


@kernel(float64(LINEAR, DATA, DATA))
def largest_error(problem, answer, nu):
    """Return the error of an answer; infinite where that is no number.

    Parameters
    ----------
    answer : z and the multipliers of rows. nu : the multipliers of bounds, compared with f; of size 0 without.
    """
    N = answer.size
    if N == 0:
        return 0.0
    room, count = np.empty((7, N)), 1 + problem[7].max()
    x, f, sizes, sums, needed, x_unit, f_unit = room[0], room[1], room[2], room[3], room[4], room[5], room[6]
    x[:] = answer
    _rows(problem, x, f, sizes, sums)
    for i in range(N):
        if not np.isfinite(f[i] * sums[i]):  # one test for both, NaN included
            return np.inf
    known, size = np.zeros((6, count), np.bool_), np.zeros((9, count))
    _needed(problem, x, f, sizes, sums, needed, known, size)
    _sizes(problem, sizes, sums, needed, known, size)
    _units(problem, known, size, x_unit, f_unit)
    error = _distances(problem, x, f, sums, needed, x_unit, f_unit, nu, known, size)
    return max(error, _gap(problem, x, f, sizes, sums, x_unit, f_unit, known, size))


@helper(boolean(float64, float64, float64, float64, float64))
def _settled(low, high, x, f, noise):
    """Return whether an unknown is within its bounds, and its row is 0 to rounding or holds it at one."""
    # exactly at the bound: then any force of the right sign is allowed
    held = (f > 0.0 and x == low) or (f < 0.0 and x == high)
    return low <= x <= high and (held or abs(f) <= noise)


@kernel(boolean(CSR, CSR, DATA, DATA, int64, DATA, DATA, DATA))
def exact(M, G, q, h, m, lb, ub, x):
    """Return whether the answer is exact to rounding. Then no part has an error of more than a few times that, and that
    takes no units. The arguments are those of `linear`, and x, the unknowns and multipliers."""
    n = q.size
    f, terms = q.copy(), np.abs(q)
    for i in range(h.size):
        y, value, sizes = x[n + i], -h[i], abs(h[i])  # sizes bound what rounding can make of the sum
        for k in range(G[0][i], G[0][i + 1]):
            value += G[2][k] * x[G[1][k]]
            sizes += abs(G[2][k] * x[G[1][k]])
            f[G[1][k]] -= G[2][k] * y
            terms[G[1][k]] += abs(G[2][k] * y)
        if not _settled(0.0 if i < m else -np.inf, np.inf, y, value, NOISE * sizes):
            return False
    for i in range(n):
        for k in range(M[0][i], M[0][i + 1]):
            f[i] += M[2][k] * x[M[1][k]]
            terms[i] += abs(M[2][k] * x[M[1][k]])
        if not _settled(lb[i], ub[i], x[i], f[i], NOISE * terms[i]):
            return False
    return True


@helper(boolean(DATA_2D, DATA, DATA_2D, DATA, DATA_2D, DATA, DATA, DATA, DATA, DATA, DATA, DATA))
def exact_program(Q, p, A, b, C, d, lb, ub, z, lam, mu, nu):
    """Return whether an answer, λ ≥ 0 and z within its bounds, is exact to rounding: every row that does not hold its
    unknown where it is, is 0. No part has an error of more than a few times that then, and that takes no units."""
    n = p.size
    f, terms = p.copy(), np.abs(p)
    for k in range(b.size + d.size):
        row, y, side = (A[k], lam[k], b[k]) if k < b.size else (C[k - b.size], mu[k - b.size], d[k - b.size])
        value, sizes = -side, abs(side)
        for j in range(n):
            value += row[j] * z[j]
            sizes += abs(row[j] * z[j])
            f[j] -= row[j] * y
            terms[j] += abs(row[j] * y)
        if not (abs(value) <= NOISE * sizes or (k < b.size and y == 0.0 and value > 0.0)):
            return False
    for i in range(n):
        for j in range(n):
            f[i] += Q[i, j] * z[j]
            terms[i] += abs(Q[i, j] * z[j])
        # exactly: `exact` promises no error at all
        held = (f[i] > 0.0 and z[i] == lb[i]) or (f[i] < 0.0 and z[i] == ub[i])
        if not ((held or abs(f[i]) <= NOISE * terms[i]) and abs(f[i] - nu[i]) <= NOISE * terms[i]):
            return False
    return True
