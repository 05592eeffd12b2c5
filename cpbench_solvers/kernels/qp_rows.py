"""The error of an answer to a quadratic program by its connected parts, which norms over all hide.

With the names of `qp_parts`: rows f beside z have one size in a part, and rows beside y another, the largest D_i Σ_j
|K_ij x_j|, or D_i |c_i| where the constant counts; that of rows beside y is at least what z makes of a row, |z_i|/D_i.
A constant counts unless the row holds its unknown on its bound and the other terms are small beside it. The force that
a bound written as a row takes is no such term. An unknown has its unit from its largest effect on a row, or from its
bounds where both are finite. Where nothing gives a part a size, its z is 0 and compared with 1.

The error is the largest of

- the distances of x and f from their sets, in these units; of constraints and bounds in their own terms (`own_miss`),
- the gap Σ |x_i f_i| of a part, x counted from the bound to which f pushes, at most its unit, over the terms of the
  objective, max(|½zᵀQz + pᵀz|, ½|zᵀQz|, min(Σ|p_i z_i|, Σ|h_j y_j|)),
- and the square of growth: of the distances of rows beside y in the sizes of the constants alone, and of what a
  gradient that no bound takes could change in the objective.

Rounding of terms that cancel, 8 eps Σ|terms|, is no error in the last two.
"""

import numpy as np
from numba import boolean, float64, njit

from cpbench_solvers.kernels.array_types import COMPILED, DATA, DATA_2D, FAST
from cpbench_solvers.kernels.qp_dense import reached
from cpbench_solvers.kernels.qp_gap import NOISE, gap_errors, gaps, own_miss, row_products, without
from cpbench_solvers.kernels.qp_parts import PROGRAM

BALANCED = 0.1
"""Share of an idle constant that the other terms of its row must reach for it to count."""


@njit(boolean(float64, float64, float64, float64), **COMPILED)
def is_idle(low, high, x, f):
    """Return whether the row f pushes its unknown towards its nearer bound."""
    below, above = abs(x - low), abs(high - x)  # infinite where there is no bound
    if f > 0.0:
        return low > -np.inf and below <= above
    return f < 0.0 and high < np.inf and above <= below


@njit(boolean(float64, float64, float64), **COMPILED)
def is_fixed(low, high, x):
    """Return whether an unknown is at a bound that is not 0, or beyond."""
    beyond = (low != 0.0 and low > -np.inf and x <= low) or (high != 0.0 and high < np.inf and x >= high)
    return beyond or reached(low, x) or reached(high, x)


@njit(inline="always")
def _terms(start, column, value, i, x, sizes, of_z):
    """Return Σ_j K_ij x_j, Σ_j |K_ij| sizes_j and Σ_j |K_ij| of_z_j."""
    total = terms = own = 0.0
    for k in range(start[i], start[i + 1]):
        j, size = column[k], abs(value[k])
        total += value[k] * x[j]
        terms += size * sizes[j]
        own += size * of_z[j]
    return total, terms, own


@njit(fastmath=FAST, **COMPILED)
def fixed_terms(program, x, sizes, beside):
    """Write Σ_j |K_ij| sizes_j over the unknowns that are fixed."""
    n, start, column, value, _, low, high = program[:7]
    start, column = start.view(np.uint64), column.view(np.uint64)
    fixed = np.zeros(x.size)
    for i in range(n):
        if is_fixed(low[i], high[i], x[i]):
            fixed[i] = sizes[i]
    for i in range(x.size):
        beside[i] = _terms(start, column, value, i, fixed, fixed, fixed)[1]


@njit(fastmath=FAST, **COMPILED)
def row_terms(program, x, f, sizes, sums, own, taken):
    """Write the rows f, the sizes of the unknowns, Σ_j |K_ij||x_j|, that of z alone, and what bounds that are written
    as rows take."""
    n, start, column, value, c, low, high = program[:7]
    start, column = start.view(np.uint64), column.view(np.uint64)
    for i in range(x.size):
        # outside of its bounds an unknown counts with where it should be, too
        sizes[i] = max(abs(x[i]), abs(min(max(x[i], low[i]), high[i])))
    taken[:] = 0.0
    of_z = sizes.copy()
    for i in range(n, x.size):
        of_z[i] = 0.0
    for i in range(x.size):
        total, sums[i], own[i] = _terms(start, column, value, i, x, sizes, of_z)
        f[i] = c[i] + total
        if i >= n:
            if start[i + 1] - start[i] == 1:
                # a row of one unknown is a bound: its multiplier belongs to no size
                taken[column[start[i]]] += abs(value[start[i]]) * sizes[i]
            if low[i] == high[i]:  # a row without a side
                f[i] = 0.0  # nothing can be wrong with it


@njit(**COMPILED)
def _counted(program, x, f, sizes, sums, own, taken, needed, beside):
    """Write which constants count (1 or 0), and the terms of every row in unknowns that a bound fixes; return of every
    group of rows (2 · parts) whether something gives it a size, and of every part whether its z is known."""
    n, start, column, _, c, low, high, part = program[:8]
    start, column = start.view(np.uint64), column.view(np.uint64)
    count = program[10].size
    sized, some, known = np.zeros(2 * count), np.zeros(2 * count), np.zeros(count)
    fixed_terms(program, x, sizes, beside)
    for i in range(x.size):
        group = part[i] + (count if i >= n else 0)
        terms = sums[i] - taken[i]
        idle = is_idle(low[i], high[i], x[i], f[i]) or abs(f[i]) < 0.5 * taken[i]
        balanced = terms > BALANCED * abs(c[i])
        needed[i] = 1.0 if c[i] != 0.0 and (balanced or not idle) else 0.0
        if beside[i] > 0.0:
            sized[group] = 1.0
        if needed[i] > 0.0:
            sized[group] = some[group] = 1.0
            if i < n and (own[i] > BALANCED * abs(c[i]) or not balanced):
                known[part[i]] = 1.0
        if i < n and is_fixed(low[i], high[i], x[i]):
            known[part[i]] = 1.0
    for q in range(count):
        known[q] = max(known[q], sized[count + q])  # rows beside y measure z
        sized[count + q] = known[q]
    return sized, some, known


@njit(**COMPILED)
def _units(program, sizes, sums, taken, needed, sized, some, known, unit, effect):
    """Write 1 over the size of every row and of every unknown."""
    n, start, column, value, c, low, high, part, D = program[:9]
    start, column = start.view(np.uint64), column.view(np.uint64)
    count = known.size
    size, reach = np.zeros(2 * count), np.zeros(count)
    for i in range(n):
        reach[part[i]] = max(reach[part[i]], sizes[i] / D[i])
    for i in range(unit.size):
        group = part[i] + (count if i >= n else 0)
        terms = sums[i] - taken[i]
        counts = needed[i] > 0.0 or some[group] == 0.0
        own = D[i] * (max(terms, abs(c[i])) if counts else terms)
        if i >= n and known[part[i]] > 0.0:
            own = max(own, reach[part[i]])  # a row of constants 0 must not make a unit of rounding
        size[group] = max(size[group], own)
    effect[:] = 0.0
    for i in range(unit.size):
        group = part[i] + (count if i >= n else 0)
        if known[part[i]] > 0.0:
            unit[i] = D[i] / size[group] if size[group] > 0.0 else 1.0
        else:  # every row has its own terms, z at least 1
            alone = abs(c[i])
            total = 0.0
            for k in range(start[i], start[i + 1]):
                if column[k] < n:
                    total += abs(value[k]) * max(sizes[column[k]], 1.0)
            alone = max(alone, total)
            unit[i] = 1.0 / alone if alone > 0.0 else 1.0
        if taken[i] > 0.0:
            unit[i] = min(unit[i], 1.0 / taken[i])  # what a bound takes may be large: its rounding is no error
        if sized[group] > 0.0:
            for k in range(start[i], start[i + 1]):
                effect[column[k]] = max(effect[column[k]], abs(value[k]) * unit[i])
    for i in range(unit.size):
        whole = max(abs(low[i]), abs(high[i]))
        if i < n and 0.0 < whole < np.inf:
            effect[i] = max(effect[i], 1.0 / whole)
        if effect[i] == 0.0 or (i < n and known[part[i]] == 0.0):
            effect[i] = 1.0
        if program[10][part[i]] == 0.0:  # without an objective no multipliers are needed, and any will do
            if i < n:
                unit[i] = 0.0
            else:
                effect[i] = 0.0


@njit(float64(float64, float64, float64), **COMPILED)
def _excess(low, high, w):  # the part of a row that no unknown may have beside it
    return max(0.0 if low > -np.inf else w, 0.0 if high < np.inf else -w, 0.0)


@njit(float64(PROGRAM, DATA, DATA), **COMPILED)
def largest_error(program, x, nu):
    """Return the largest error of a part; infinite where that is no number.

    Parameters
    ----------
    x : z and the multipliers of rows. nu : (n,) those of bounds, compared with f.
    """
    n, c, low, high, part, D, constants = program[0], *program[4:10]
    N, count = x.size, program[10].size
    room = np.empty((10, N))
    f, sizes, sums, own, taken, needed, beside, unit, effect, products = (
        room[0], room[1], room[2], room[3], room[4], room[5], room[6], room[7], room[8], room[9],
    )  # fmt: skip
    row_terms(program, x, f, sizes, sums, own, taken)
    sized, some, known = _counted(program, x, f, sizes, sums, own, taken, needed, beside)
    _units(program, sizes, sums, taken, needed, sized, some, known, unit, effect)
    objective, gap, alone, most = np.zeros(count), np.zeros(count), np.zeros(count), np.zeros(count)
    given = gaps(program, x, f, sums, needed, known, unit, effect, products, objective, most)
    for i in range(N):
        if i < n:
            gap[part[i]] += abs(products[i])
        alone[part[i]] += abs(products[i]) * unit[i] * effect[i]
        if not np.isfinite(f[i] * sums[i]):
            return np.inf
    row_products(program, f, sums, unit, products, gap)
    error = gap_errors(known, np.minimum(gap, most), given, alone, objective)
    data = constants.copy()
    for i in range(N):
        group = part[i] + (count if i >= n else 0)
        data[group] = max(data[group], D[i] * beside[i])
    growth = 0.0
    for i in range(N):
        w = f[i] * unit[i]
        # complementarity by its two distances, each in its own unit
        below = (low[i] - x[i]) * effect[i] if low[i] > -np.inf else w
        above = (x[i] - high[i]) * effect[i] if high[i] < np.inf else -w
        own_units = unit[i], effect[i] if known[part[i]] > 0.0 else 0.0
        missed = own_miss(i >= n, low[i], high[i], x[i], f[i], sums[i] + abs(c[i]), *own_units)
        error = max(error, below, above, missed)
        w = without(f[i], NOISE * (sums[i] + abs(c[i])))
        if i < n:
            error = max(error, abs(f[i] - nu[i]) * unit[i] / max(1.0, abs(f[i] * unit[i])))
            if known[part[i]] > 0.0 and unit[i] > 0.0 and objective[part[i]] > 0.0:
                growth = max(growth, _excess(low[i], high[i], w) / (effect[i] * objective[part[i]]))
        elif data[count + part[i]] > 0.0:
            growth = max(growth, _excess(low[i], high[i], w) * D[i] / data[count + part[i]])
    growth = min(growth, 1.0)
    return max(error, growth * growth)


@njit(boolean(DATA_2D, DATA, DATA_2D, DATA, DATA_2D, DATA, DATA, DATA, DATA, DATA, DATA, DATA), **COMPILED)
def exact(Q, p, A, b, C, d, lb, ub, z, lam, mu, nu):
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
