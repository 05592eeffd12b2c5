"""The error of an answer to an affine problem in a box by its connected parts, which norms over all hide.

Units are those of `qp_rows`. Where there are no multipliers, rows of free unknowns have a size apart from the others,
at least √eps of theirs. The error is the largest of the distances |x − P(x − f)| in these units, P the projection on
the box, with the `own_miss` of constraints; the gap Σ |x_i f_i| of a part over the terms of its objective, without
multipliers in units over max(Σ|c_i x_i|, |xᵀMx|); and the square of growth: of the distances in the sizes of the
constants alone. Rounding of terms that cancel, 8 eps Σ|terms|, is no error in the last two.
"""

import numpy as np
from numba import boolean, float64, int64, njit

from cpbench_solvers.kernels.affine_parts import AFFINE
from cpbench_solvers.kernels.array_types import COMPILED, DATA
from cpbench_solvers.kernels.qp_gap import NOISE, own_miss, product, row_products, without
from cpbench_solvers.kernels.qp_ldl import CSR
from cpbench_solvers.kernels.qp_rows import BALANCED, fixed_terms, is_fixed, is_idle, row_terms

HIDDEN = np.sqrt(np.finfo(np.float64).eps)
"""The least size of equalities, as a share of that of all rows of their group."""


@njit(float64(float64, float64, float64, float64, float64, float64), **COMPILED)
def _distance(low, high, x, w, x_unit, w_unit):
    """Return |x − P(x − w)| in units; no difference of x and x − w, in which a small w is lost beside a large x."""
    step = w * w_unit  # |x − P(x − w)| = |mid(w, x − high, x − low)|
    if low > -np.inf:
        step = min(step, (x - low) * x_unit)
    if high < np.inf:
        step = max(step, (x - high) * x_unit)
    return abs(step)


@njit(float64(float64, float64), **COMPILED)
def _own_size(low, high):
    """Return the size of the set of an unknown, 0 where it has none."""
    return max(abs(low), abs(high)) if max(abs(low), abs(high)) < np.inf else 0.0


@njit(**COMPILED)
def _counted(program, x, f, sizes, sums, own, taken, needed, beside):
    """Write which constants count (1 or 0), and the terms of every row in unknowns that a bound fixes; return of every
    group whether something gives it a size and whether a constant of it counts, and of every part whether its unknowns
    have one."""
    n, start, column, _, c, low, high, part = program[:8]
    start, column = start.view(np.uint64), column.view(np.uint64)
    group, constants = program[9], program[10]
    sized, some, known = np.zeros(constants.size), np.zeros(constants.size), np.zeros(part.max() + 1)
    fixed_terms(program, x, sizes, beside)
    for i in range(x.size):
        terms = sums[i] - taken[i]
        idle = is_idle(low[i], high[i], x[i], f[i]) or abs(f[i]) < 0.5 * taken[i]
        balanced = terms > BALANCED * abs(c[i])
        needed[i] = 1.0 if c[i] != 0.0 and (balanced or not idle) else 0.0
        if beside[i] > 0.0:
            sized[group[i]] = 1.0
        if needed[i] > 0.0:
            sized[group[i]] = some[group[i]] = 1.0
            if i < n and (own[i] > BALANCED * abs(c[i]) or not balanced):
                known[part[i]] = 1.0
        if i < n and is_fixed(low[i], high[i], x[i]):
            known[part[i]] = 1.0
    for i in range(n, x.size):
        known[part[i]] = max(known[part[i]], sized[group[i]])
    for i in range(n, x.size):
        sized[group[i]] = max(sized[group[i]], known[part[i]])
    return sized, some, known


@njit(**COMPILED)
def _row_units(program, sizes, sums, taken, needed, sized, some, known, of_x, unit):
    """Write 1 over the size of every row; known : of parts, of_x : of unknowns without multipliers."""
    n, start, column, value, c, low, high, part, D, group, constants, kind = program
    start, column = start.view(np.uint64), column.view(np.uint64)
    size, reach, with_rows = np.zeros(constants.size), np.zeros(known.size), n < unit.size
    of_kind = np.zeros(2 * constants.size)
    for i in range(n):
        reach[part[i]] = max(reach[part[i]], sizes[i] / D[i])
    for i in range(unit.size):
        terms = sums[i] - taken[i]
        counts = needed[i] > 0.0 or some[group[i]] == 0.0
        own = D[i] * (max(terms, abs(c[i])) if counts else terms)
        if i >= n and known[part[i]] > 0.0:
            own = max(own, reach[part[i]])
        size[group[i]], of_kind[kind[i]] = max(size[group[i]], own), max(of_kind[kind[i]], own)
    for i in range(unit.size):
        whole = max(of_kind[kind[i]], HIDDEN * size[group[i]])
        if (known[part[i]] if with_rows else sized[group[i]]) > 0.0:
            unit[i] = D[i] / whole if whole > 0.0 else 1.0
        else:  # every row has its own terms, unknowns without a size at least 1
            alone = abs(c[i])
            total = 0.0
            for k in range(start[i], start[i + 1]):
                j = column[k]
                if j < n:
                    total += abs(value[k]) * max(sizes[j], _own_size(low[j], high[j]) if of_x[j] > 0.0 else 1.0)
            alone = max(alone, total)
            unit[i] = 1.0 / alone if alone > 0.0 else 1.0
        if taken[i] > 0.0:
            unit[i] = min(unit[i], 1.0 / taken[i])


@njit(**COMPILED)
def _effects(program, unit, counts, effect):
    """Write the largest effect of every unknown on a row that counts."""
    start, column, value = program[1].view(np.uint64), program[2].view(np.uint64), program[3]
    effect[:] = 0.0
    for i in range(unit.size):
        if counts[i] > 0.0:
            for k in range(start[i], start[i + 1]):
                effect[column[k]] = max(effect[column[k]], abs(value[k]) * unit[i])


@njit(**COMPILED)
def _units(program, sizes, sums, taken, needed, sized, some, known, of_x, unit, effect):
    """Write 1 over the size of every row and of every unknown, and of which unknowns the size is known."""
    n, low, high, part, group = program[0], program[5], program[6], program[7], program[9]
    counts, with_rows = np.empty(unit.size), n < unit.size
    for i in range(unit.size):
        counts[i], unit[i] = sized[group[i]], 1.0
    _effects(program, unit, counts, effect)
    for i in range(unit.size):
        has_size = effect[i] > 0.0 or _own_size(low[i], high[i]) > 0.0
        of_x[i] = known[part[i]] if with_rows else (1.0 if has_size else 0.0)
    _row_units(program, sizes, sums, taken, needed, sized, some, known, of_x, unit)
    _effects(program, unit, counts, effect)
    for i in range(unit.size):
        if _own_size(low[i], high[i]) > 0.0:
            effect[i] = max(effect[i], 1.0 / _own_size(low[i], high[i]))
        if effect[i] == 0.0 or (i < n and of_x[i] == 0.0):
            effect[i] = 1.0


@njit(**COMPILED)
def _gap(program, x, f, sums, unit, effect, of_x):
    """Return the largest error of the gap of a part."""
    n, c, low, high, part = program[0], program[4], program[5], program[6], program[7]
    count, with_rows = part.max() + 1, n < x.size
    products, gap, alone, absolute = np.empty(x.size), np.zeros(count), np.zeros(count), np.zeros(count)
    quadratic, prices, straight, sides = np.zeros(count), np.zeros(count), np.zeros(count), np.zeros(count)
    for i in range(x.size):
        q, size = part[i], 1.0 / unit[i]
        weight = 1.0 if with_rows else unit[i] * effect[i]
        w = without(f[i], NOISE * max(sums[i] + abs(c[i]), size))  # or a sum that cancels would make a gap of rounding
        products[i] = weight * product(low[i], high[i], x[i], w, 1.0 / effect[i])
        quadratic[q] += weight * x[i] * (w - c[i])
        alone[q] += abs(products[i]) * (unit[i] * effect[i] if with_rows else 1.0)
        if i < n:
            gap[q] += abs(products[i])
            prices[q] += weight * x[i] * c[i]
            straight[q] += weight * abs(x[i] * c[i])
        else:
            sides[q] += abs(x[i] * c[i])
        if of_x[i] == 0.0:
            absolute[q] = 1.0
    row_products(program, f, sums, unit, products, gap)
    worst = 0.0
    for q in range(count):
        if absolute[q] > 0.0:
            worst = max(worst, alone[q])  # nothing gives this part a size: the gap itself, in units
        elif gap[q] > 0.0:
            half = 0.5 * quadratic[q]
            if with_rows:
                terms = max(max(abs(half + prices[q]), abs(half)), min(straight[q], sides[q]))
            else:
                # no multipliers, hence no objective of a dual to compare with
                terms = max(straight[q], abs(quadratic[q]))
            size = max(terms, gap[q])
            error = gap[q] / size
            worst = max(worst, error if with_rows or size >= 1.0 else min(error, size))
    return worst


@njit(boolean(float64, float64, float64, float64, float64), **COMPILED)
def _settled(low, high, x, f, noise):
    """Return whether an unknown is within its bounds, and its row is 0 to rounding or holds it at one."""
    # exactly at the bound: then any force of the right sign is allowed
    held = (f > 0.0 and x == low) or (f < 0.0 and x == high)
    return low <= x <= high and (held or abs(f) <= noise)


@njit(boolean(CSR, CSR, DATA, DATA, int64, DATA, DATA, DATA), **COMPILED)
def exact(M, G, q, h, m, lb, ub, x):
    """Return whether the answer is exact to rounding. Then no part has an error of more than a few times that, and that
    takes no units. The arguments are those of `affine`, and x, the unknowns and multipliers."""
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


@njit(float64(AFFINE, DATA), **COMPILED)
def largest_error(program, x):
    """Return the largest error of a part; infinite where that is not a number."""
    c, low, high, D, group = program[4], program[5], program[6], program[8], program[9]
    N = x.size
    room = np.empty((10, N))
    f, sizes, sums, own, taken, needed, beside, of_x, unit, effect = (
        room[0], room[1], room[2], room[3], room[4], room[5], room[6], room[7], room[8], room[9],
    )  # fmt: skip
    row_terms(program, x, f, sizes, sums, own, taken)
    for i in range(N):
        if not np.isfinite(f[i] * sums[i]):  # one test for both, NaN included
            return np.inf
    if N == 0:
        return 0.0
    sized, some, known = _counted(program, x, f, sizes, sums, own, taken, needed, beside)
    _units(program, sizes, sums, taken, needed, sized, some, known, of_x, unit, effect)
    error = _gap(program, x, f, sums, unit, effect, of_x)
    data, always = program[10].copy(), np.ones(N)
    for i in range(N):
        error = max(error, _distance(low[i], high[i], x[i], f[i], effect[i], unit[i]))
        if program[0] < N:
            own_units = unit[i], effect[i] if of_x[i] > 0.0 else 0.0
            error = max(error, own_miss(i >= program[0], low[i], high[i], x[i], f[i], sums[i] + abs(c[i]), *own_units))
        data[group[i]] = max(data[group[i]], D[i] * beside[i])
    for i in range(N):
        unit[i] = D[i] / data[group[i]] if data[group[i]] > 0.0 else 0.0
    _effects(program, unit, always, effect)
    growth = 0.0
    for i in range(N):
        w = without(f[i], NOISE * (sums[i] + abs(c[i])))
        # compared with constants alone: a large answer hides a miss in its own terms
        growth = max(growth, _distance(low[i], high[i], x[i], w, effect[i], unit[i]))
    growth = min(growth, 1.0)
    return max(error, growth * growth)  # the square: an answer may be as large as 1/√tolerance of its constants
