"""Error of an answer to a program, a complementarity problem or an affine inequality.

All of them are unknowns x in sets beside rows f that are linear in x, and are measured by one function: so an answer
has the same verdict as lcp, mlcp, avi and qp. `docs/methods/verdict.md` shows that function with its reasons. What
methods hold in norms is measured in norms; a constraint or a bound counts by its own terms, too, and what is left is
the duality gap, over the objective itself, or where rows have no objective the lesser number of each pair. Nonlinear
programs are measured by their linearization at the answer.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from cpbench.foundation.matrices import SYMMETRY_TOLERANCE, Vector
from cpbench.verification.rows import EPS, FAR_BELOW, ROUNDINGS, AnswerError, Groups, Layout, System
from cpbench.verification.sets import Flags, inverse

OWN = 0.1
"""Share by which a constraint or a bound is compared with its own terms: it is missed by at most 10 ε of them."""
SMALL = 1e-5
"""Share of the largest below which the terms of such a row say nothing: they may be rounding of others."""
BALANCED = 0.1
"""Share of an idle constant that the other terms of its row must reach for it to give a size."""


@dataclass(frozen=True, eq=False)
class AnswerSizes:
    """Sizes that an answer is compared with; those of a group have the shape (count,), the others (k,).

    Attributes
    ----------
    sums : Σ_j |J_ij||x_j|. needed : constants that the answer needs. x, f : sizes of unknowns and of rows; ∞ where
        anything will do.
    prices, cheapest, sides : of a group the largest and the least constant of the gradient, and the largest of
        constraints and bounds, in units.
    reach : of a group how large sides make z, or prices where the objective is curved, in units.
    absolute : whether the data give a group no size, so that all are 1.
    """

    sums: Vector
    needed: Vector
    x: Vector
    f: Vector
    prices: Vector
    cheapest: Vector
    sides: Vector
    reach: Vector
    absolute: Flags


def linear_error(system: System, problem: Groups | None = None) -> AnswerError:
    """Measure an answer; of several problems side by side, each by itself.

    problem : the problem that each block belongs to, None where there is one. Errors are those of the problems.
    """
    layout = system.frame.layout if problem is None else Layout.of_problems(system.frame, problem)
    problem, of = problem or Groups.one(system.frame.k), layout.of
    sums = system.frame.terms @ system.sizes
    if not np.isfinite(sums).all():  # squares of such unknowns are no numbers any more
        return AnswerError(np.full(problem.count, np.inf), np.zeros(problem.count))
    sizes = sizes_of(system, layout, sums)
    errors, (gap, floor) = of.largest(distances(system, layout, sizes)), gap_error(system, layout, sizes)
    errors = np.maximum(errors, gap)
    if of.count > 1:
        errors, floor = (problem.largest(of.spread(values)) for values in (errors, floor))
    alike, apart = system.frame.alike, np.zeros(problem.count)
    if alike is not None:
        n = system.frame.k - system.frame.rows.shape[0]
        equality, terms = np.isinf(system.frame.sets.lb[n:]), sums[n:] + system.frame.constants[n:]
        own = None if problem.of is None else problem.of[n + alike.first]
        missed = alike.missed(system.x[:n], system.f[n:], terms, equality)
        apart = Groups(own, problem.count, missed.size).largest(missed)
    return AnswerError(errors, floor, bool(sizes.absolute.any()), apart=apart)


def sizes_of(system: System, layout: Layout, sums: Vector) -> AnswerSizes:
    """Return the sizes of an answer, in norms: one for the gradient, the constraints, the unknowns, the multipliers."""
    frame, of, z, D, C = system.frame, layout.of, layout.z, layout.D, layout.C
    curved, constrained = layout.curved, layout.constrained

    def largest(values: Vector, where: Flags) -> Vector:
        return of.largest(np.where(where, values, 0.0))

    def least(values: Vector, where: Flags) -> Vector:
        return inverse(largest(inverse(values), where))

    # not needed is the constant of a row that is far from deciding anything, and one far below others stands for 0
    constants, reach = D * frame.constants, system.sizes / C
    rows, counts = D * sums, constants.copy()
    counts[frame.any(frame.sets.idle(system.x, system.f)) & (rows <= BALANCED * constants)] = 0.0
    prices, sides = largest(counts, z), largest(counts, ~z)
    most = np.maximum(prices, sides)
    own, beside = np.where(curved, most, prices), np.where(curved, most, sides)
    far_below = constants <= FAR_BELOW * np.where(z, of.spread(own), of.spread(beside))
    constants[far_below] = counts[far_below] = 0.0
    prices, sides = largest(counts, z), largest(counts, ~z)
    needed = np.where(np.where(z, of.spread(prices), of.spread(sides)) > 0, counts, constants)
    driven = curved & (prices > 0)
    sides = np.maximum(sides, largest(reach, system.fixed & z))
    bare = (sides == 0) & ~driven  # as where 0 is the solution: the least constant is a size
    at_0 = (sides == 0) & (constrained | ~driven)  # constraints without sides may hold 0 against prices, too
    prices, cheapest = largest(needed, z), least(needed, z)
    sides = np.where(sides > 0, sides, largest(needed, ~z))
    if bare.any():
        far = np.where(z, frame.largest(frame.sets.sides) / C, needed)
        sides, prices = np.where(bare, least(far, far > 0), sides), np.where(bare, cheapest, prices)
    # without an objective any multipliers will do, 1e-9 as well as 0
    aimless = constrained & ~curved & layout.program & (largest(constants, z) == 0)
    absolute = ((sides == 0) & (prices == 0)) | (aimless & (not frame.certifying))

    rows = np.maximum(rows, needed)
    gradient, unknowns = largest(rows, z), largest(reach, z)
    unknowns = np.where(at_0, np.maximum(unknowns, np.maximum(sides, np.where(curved, cheapest, 0.0))), unknowns)
    reach_of_data = np.maximum(sides, np.where(curved, prices, 0.0))
    unknowns = np.where((unknowns > 0) | layout.program, unknowns, reach_of_data)  # 0 is not near its bounds
    multipliers, feeds = np.maximum(largest(reach, ~z), gradient), np.maximum(largest(rows, ~z), unknowns)
    x = C * np.where(z, of.spread(unknowns), of.spread(multipliers))
    f = np.where(z, of.spread(gradient), of.spread(feeds)) / D
    if absolute.any() or aimless.any():
        none, free = of.spread(absolute), of.spread(aimless)
        x = np.where(none, 1.0, np.where(free & ~z, np.inf, x))
        f = np.where(none, 1.0, np.where(free & z, np.inf, f))
    return AnswerSizes(sums, needed / D, x, f, prices, cheapest, sides, reach_of_data, absolute)


def distances(system: System, layout: Layout, sizes: AnswerSizes) -> Vector:
    """Return how far unknowns and rows are from where they must be, over their sizes, (k,)."""
    frame, of, z = system.frame, layout.of, layout.z
    x_unit, f_unit = inverse(sizes.x), inverse(sizes.f)
    # a constraint, or a bound other than 0, is missed by at most 10 ε of its own terms
    terms = np.where(z & of.spread(layout.constrained), 0.0, sizes.sums + sizes.needed)
    by_terms = np.maximum(f_unit, by_own_terms(terms, f_unit))
    by_bound = x_unit
    if frame.sets.moored:
        missed = frame.largest(frame.sets.missed(system.x))
        beyond = np.where(z & (missed > 0), missed + frame.norms(system.x), 0.0)
        by_bound = np.maximum(x_unit, by_own_terms(beyond, x_unit))
    # unknowns that cancel may be as large as one likes, and hide by that no more than √ε of the data
    by_data = layout.D * of.spread(np.where(sizes.absolute, 0.0, inverse(sizes.reach)))
    distance = system.distances(by_bound, by_terms)
    grown = system.distances(np.zeros_like(x_unit), np.where(z, 0.0, by_data))
    if not layout.program.all():  # without an objective that is right, a pair of two small numbers is off by the lesser
        program = of.spread(layout.program)
        distance = np.where(program, distance, system.defect(by_bound, by_terms))
        grown = np.where(program, grown, system.defect(x_unit, by_data))
    if system.also is not None:
        value, at = system.also
        off = np.abs(value) * f_unit[at]  # the force of a bound has the digits of its own size
        np.maximum.at(distance, np.arange(frame.k)[at], off / np.maximum(1.0, frame.norms(system.f)[at] * f_unit[at]))
    distance = np.maximum(distance, np.minimum(grown, 1.0) ** 2)
    free = layout.curved & layout.program & (sizes.prices == 0)
    if not free.any():
        return distance
    # without prices a gradient whose terms are all below ε of what sides make of it is 0
    gradient = of.largest(np.where(z, sizes.f * layout.D, 0.0))
    share = np.divide(gradient, sizes.sides, out=np.ones_like(gradient), where=gradient < sizes.sides)
    primal = system.distances(np.where(z, by_bound, 0.0), np.where(z, 0.0, by_terms))
    primal = np.maximum(primal, np.minimum(grown, 1.0) ** 2)
    return np.where(of.spread(free), np.maximum(primal, np.minimum(distance, of.spread(share))), distance)


def by_own_terms(terms: Vector, unit: Vector) -> Vector:
    """Return by what a row or a bound is measured so that it is missed by at most 10 ε of its own terms; 0 where these
    are below rounding of others, of which `unit` is 1 over the size."""
    return OWN * inverse(np.where(terms * unit > SMALL, terms, 0.0))


def gap_error(system: System, layout: Layout, sizes: AnswerSizes) -> tuple[Vector, Vector]:
    """Return the duality gap over the objective, and the rounding of its terms over the same, of each group; 0 of what
    is no program."""
    frame, of, z = system.frame, layout.of, layout.z
    if frame.signed is None or not layout.program.any():
        return np.zeros(of.count), np.zeros(of.count)
    weight = of.spread(layout.program) & np.isfinite(sizes.x) & np.isfinite(sizes.f)
    # 0 is not near a bound, of a multiplier one that is not 0
    beyond = np.where(z, layout.C * of.spread(sizes.reach), frame.largest(frame.sets.sides))
    far = np.maximum(sizes.x, beyond)
    far = np.where(of.spread(sizes.absolute), np.inf, far)
    gap = of.sum(weight * np.abs(frame.block_sums(frame.sets.products(system.x, system.f, frame.spread(far)))))
    linear = weight * frame.block_sums(system.x * frame.signed)
    quadratic = of.sum(weight * frame.block_sums(system.x * system.f) - linear)
    straight, square = np.abs(0.5 * quadratic + of.sum(np.where(z, linear, 0.0))), 0.5 * np.abs(quadratic)
    # without multipliers the products of rows and of constants have the same unknowns, whatever cancels
    straight = np.where(layout.constrained, straight, of.sum(np.abs(linear)))
    objective = np.maximum(straight, square)
    size = np.maximum(objective, gap)
    error = np.divide(gap, size, out=np.zeros_like(gap), where=gap > 0)

    # an objective far below what the data make of it is 0: below ε of that by the least price, or ε² by squares
    by_square = np.where(layout.curved, sizes.reach, 0.0) ** 2
    by_prices = sizes.cheapest * np.minimum(sizes.reach, of.largest(np.where(z, sizes.x / layout.C, 0.0)))
    made = np.where(sizes.prices > 0, by_prices, by_square)
    share = np.divide(np.where(sizes.prices > 0, size, gap), made, out=np.ones_like(gap), where=size < made)
    rounding = ROUNDINGS * EPS * of.sum(weight * system.sizes * (sizes.sums + frame.constants))
    square = np.maximum(square - rounding, 0.0)  # the root of rounding would be 1e-8
    of_square = np.divide(square, by_square, out=(by_square > 0).astype(float), where=square < by_square)
    error = np.minimum(error, np.maximum(share, np.sqrt(of_square)))
    most = np.maximum(objective, np.maximum(made, by_square))
    floor = np.divide(rounding, most, out=np.zeros_like(gap), where=most > 0)
    return np.where(sizes.absolute, gap, error), floor


def orientation(J: Any) -> tuple[Flags, Flags]:
    """Return which unknowns of the rows Jx + c are multipliers, and which are in a part that is a program at all.

    The conditions of a program are rows that are symmetric but for the signs of those of multipliers: J_ij = J_ji
    between unknowns of one kind, J_ij = −J_ji between both kinds. Of each connected part the first unknown is none.
    """
    n = J.shape[0]
    if not J.size or abs(J - J.T).max() <= SYMMETRY_TOLERANCE * abs(J).max():
        return np.zeros(n, dtype=bool), np.ones(n, dtype=bool)
    J = sp.csr_array(J)
    T = sp.csr_array(J.T)
    uneven: Any = sp.coo_array(abs(abs(J) - abs(T)) - SYMMETRY_TOLERANCE * abs(J).maximum(abs(T)))
    both: Any = sp.coo_array(J.multiply(T))
    (i, j), alike = both.coords, both.data > 0
    # twice every unknown: as it is, and as a multiplier
    ends = np.concatenate([np.where(alike, j, j + n), np.where(alike, j + n, j)])
    graph = sp.coo_array((np.ones(ends.size), (np.concatenate([i, i + n]), ends)), shape=(2 * n, 2 * n))
    label = connected_components(graph, directed=False)[1]
    part = connected_components(J, directed=False)[1]
    broken = np.zeros(n, dtype=bool)
    broken[part[label[:n] == label[n:]]] = True
    broken[part[uneven.coords[0][uneven.data > 0]]] = True
    return label[:n] > label[n:], ~broken[part]
