"""Error of an answer to a linear or contact problem or a program, measured over connected parts of the problem.

`docs/methods/verdict.md` defines it: distances in the units of `sizes` (`_conditions`), the gap of each part over the
terms of its objective, and growth, the same error with sizes by the constants alone, of which the square counts: a
solution may be large beside the constants. Unknowns that a problem leaves free may be of any size, and must hide
nothing: gap and growth count for that.

Methods hold their conditions in norms: a row that is small beside its neighbours is as wrong as they are, and a
solution that decays has no digits of its own in its tail. So rows of a part share one size; what a constraint
misses of its own terms counts by `OWN`, too.

Rounding of terms that cancel, 8 eps Σ|terms|, is no error in gap and growth. Where it hides `UNKNOWN` of the constants,
the answer would solve other constants as well, and is `unresolvable`.
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Vector
from cpbench.verification.backward_error import EPS, ROUNDINGS, BackwardError, BlockErrors
from cpbench.verification.frame import Frame, System, every, inverse, some
from cpbench.verification.parts import Measure, Parts
from cpbench.verification.sets import Flags
from cpbench.verification.sizes import AnswerUnits, units_of

OWN = 0.1
"""Share by which a constraint or a bound of a program is compared with its own terms: it is missed by at most 10 ε of
them, however large others are."""
SMALL = 1e-5
"""Share of the size of its part below which the terms of such a row say nothing: they may be rounding of others."""
UNKNOWN = 0.1
"""Share of the constants of a row that is taken off as rounding, from which on the answer says nothing of them."""
_PARTS: WeakKeyDictionary[Frame, Parts] = WeakKeyDictionary()


def parts_of(frame: Frame, measure: Measure) -> Parts:
    """Return the parts of a problem whose matrix is the same for every answer, found once."""
    if frame not in _PARTS:
        _PARTS[frame] = Parts.of(frame, frame.terms.sizes, measure)
    return _PARTS[frame]


def parts_between(frame: Frame, other: Frame, measure: Measure) -> Parts:
    """Return the parts of a problem whose matrix depends on the point, by the larger of its entries at two of them.

    A derivative that vanishes at the answer says nothing of the units of its row and its unknown.
    """
    here, there = frame.terms.rows, other.terms.rows
    sizes = here.maximum(there) if np.isfinite(there.data).all() else here
    return Parts.of(frame, sp.csr_array(sizes), measure)


def part_error(system: System, parts: Parts) -> BackwardError:
    """Measure an answer. Rows beside multipliers are those of the primal."""
    if not system.frame.k:
        return BackwardError(0.0, False, 0.0)
    sums = system.frame.terms.sums(system.sizes)
    if not every(np.isfinite(sums)):  # squares of such unknowns are no numbers any more
        return BackwardError(np.inf, False, 0.0)
    return block_errors(system, parts, sums).worst()


def block_errors(system: System, parts: Parts, sums: Vector, least: float = 0.0) -> BlockErrors:
    """Measure an answer; `sums` are those of the sizes of the terms of its rows, all of them finite.

    least : an error that the answer has in any case; growth below its root is not measured.
    """
    frame, units = system.frame, units_of(system, parts, sums)
    scales = parts.scales(units.needed) if parts.measure is Measure.GAP else None
    share = _of_gradient(parts, units, scales)
    errors = _conditions(system, parts, units, sums, share)
    noise, amplification = (ROUNDINGS * EPS) * (sums + frame.constants), frame.amplification
    deciding = errors > 0
    if not frame.even:  # beside a coefficient of 1/eps nothing is left of how fast a contact closes: 0 tells nothing
        deciding |= (amplification * EPS >= 1.0) & (frame.norms(system.f) > 0)
    if system.velocity is not None:  # what sticks obeys the law whatever its coefficient
        stuck = system.defect(units.x, np.zeros(frame.k)) + frame.norms(system.velocity) * units.f
        contact = frame.amplification > 1.0
        amplification = np.where(contact & (stuck <= errors), 1.0, amplification)
        errors = np.where(contact, np.minimum(errors, stuck), errors)
    floors = noise * units.f * amplification * deciding
    if parts.measure is Measure.ENERGY:
        errors = parts.whole.spread(parts.whole.norm(errors))
    if system.also is not None:
        _count_also(system, units, errors, share)
    grown, unknown = _growth(system, parts, units, noise, errors, least)
    if unknown is not None:
        floors[unknown] = np.maximum(floors[unknown], UNKNOWN**2)
    if frame.signed is not None:
        # an unknown of the size of its part may be off by rounding, whatever its own size
        even = _without_rounding(system, np.maximum(noise, (ROUNDINGS * EPS) * inverse(units.f)))
        if parts.as_program:
            convex = parts.unpriced is not None and system.convex is not None and system.convex()
            bounded = parts.unpriced if convex else None
            gap, objective = _gap_of_program(even, frame.signed, parts, units, scales, bounded)
        else:
            gap, objective = _gap_of_pairs(even, frame.signed, parts, units), None
        errors = np.maximum(errors, parts.whole.spread(gap))
        if objective is not None and parts.measure is Measure.GAP:
            slope = frame.largest(_without_rounding(system, noise).excess(np.ones(frame.k))) * inverse(units.x)
            slope = np.where(units.f > 0, slope * parts.whole.spread(inverse(objective)), 0.0)
            grown = np.where(parts.beside_z, np.where(units.absolute, 0.0, slope), grown)
    absolute = some(units.absolute) and some(units.absolute & parts.beside_z & (system.sizes > 0))
    return BlockErrors(errors, np.minimum(grown, 1.0), floors, absolute)


def _conditions(system: System, parts: Parts, units: AnswerUnits, sums: Vector, share: Vector | None) -> Vector:
    """Return by how much every block misses its conditions, in units; those of the gradient at most by `share`."""
    if not parts.as_program or parts.measure is Measure.ENERGY:
        return system.defect(units.x, units.f)
    frame, (x_unit, f_unit) = system.frame, _with_own_terms(system, parts, units, sums)
    gap = parts.measure is Measure.GAP
    errors = frame.largest(system.distances(x_unit, f_unit)) if gap else system.defect(units.x, units.f)
    if gap and (share is None or every(share >= errors)):
        return errors
    primal = np.where(parts.beside_z, x_unit, 0.0), np.where(parts.beside_z, 0.0, f_unit)
    others = errors if share is None else np.minimum(errors, share)
    return np.maximum(frame.largest(system.distances(*primal)), others)


def _with_own_terms(system: System, parts: Parts, units: AnswerUnits, sums: Vector) -> tuple[Vector, Vector]:
    """Return the units of unknowns and rows, at least `OWN` over the own terms of constraints and of bounds that are
    not 0."""
    frame, sets = system.frame, system.frame.sets
    rows = np.where(parts.beside_z, 0.0, sums + frame.constants)
    f_unit = np.maximum(units.f, OWN * inverse(np.where(rows * units.f > SMALL, rows, 0.0)))
    if not sets.off_0:
        return units.x, f_unit
    missed = frame.largest(sets.missed(system.x))
    bounds = np.where(parts.beside_z & ~units.absolute & (missed > 0), missed + frame.norms(system.x), 0.0)
    return np.maximum(units.x, OWN * inverse(np.where(bounds * units.x > SMALL, bounds, 0.0))), f_unit


def _of_gradient(parts: Parts, units: AnswerUnits, scales: tuple[Vector, Vector] | None) -> Vector | None:
    """Return the share that the terms of a gradient without prices have in what sides make of it, (k,), 1 of others;
    None where all have prices."""
    if scales is None or parts.unpriced is None:
        return None
    largest = np.divide(parts.per_row, units.f, out=np.zeros_like(units.f), where=parts.beside_z & (units.f > 0))
    size, given = parts.whole.largest(largest), scales[1]
    return parts.whole.spread(np.divide(size, given, out=np.ones_like(size), where=(size < given) & parts.unpriced))


def _count_also(system: System, units: AnswerUnits, errors: Vector, share: Vector | None) -> None:
    """Count the residuals that must vanish beside f; the force of a bound has digits of its own row only."""
    assert system.also is not None
    value, at = system.also
    found = np.abs(value) * units.f[at] / np.maximum(1.0, system.frame.norms(system.f)[at] * units.f[at])
    if share is not None:
        found = np.minimum(found, share[at])
    if isinstance(at, slice):
        np.maximum(errors[at], found, out=errors[at])
    else:
        np.maximum.at(errors, at, found)


def _without_rounding(system: System, noise: Vector) -> System:
    """Return the answer with rows nearer to 0 by what rounding leaves of terms that cancel."""
    f = np.maximum(np.abs(system.f) - system.frame.spread(noise), 0.0)
    return System(system.frame, system.x, np.copysign(f, system.f))


def _products(system: System, units: AnswerUnits) -> Vector:
    """Return the products x_i f_i of every block, as far as they count."""
    frame, reach = system.frame, inverse(units.x)
    if some(units.absolute):
        reach = np.where(units.absolute, np.maximum(reach, system.sizes), reach)
    return frame.block_sums(frame.sets.products(system.x, system.f, frame.spread(reach), ROUNDINGS * EPS))


def _gap_of_pairs(system: System, signed: Vector, parts: Parts, units: AnswerUnits) -> Vector:
    """Return Σ|x̂_i f̂_i| over the terms of the objective, and at most these terms, of every part."""
    frame, whole, weights = system.frame, parts.whole, units.x * units.f
    gap = whole.sum(np.abs(weights * _products(system, units)))
    fixed = system.x * signed
    quadratic = whole.sum(weights * frame.block_sums(system.x * system.f - fixed))
    size = np.maximum(whole.sum(weights * frame.block_sums(np.abs(fixed))), np.abs(quadratic))
    size = np.maximum(size, gap)
    error = np.fmin(np.divide(gap, size, out=np.zeros(gap.shape), where=gap > 0), size)  # a size may be no number
    return np.where(whole.any(units.absolute), gap, error)


def _gap_of_program(
    system: System, signed: Vector, parts: Parts, units: AnswerUnits, scales: tuple[Vector, Vector] | None,
    bounded: Flags | None,
) -> tuple[Vector, Vector]:  # fmt: skip
    """Return Σ|x_i f_i| over the terms of the objective, and these terms, of every part; `scales` are what sides and
    prices make of z and of the gradient, and where parts are `bounded` (whole.count,), no objective is below 0."""
    frame, whole = system.frame, parts.whole
    products = _products(system, units)
    if parts.indifferent is not None:
        products = np.where(parts.indifferent, 0.0, products)
    gap = whole.sum(_each_row_once(system, parts, products) if parts.with_multipliers else np.abs(products))
    fixed = system.x * signed
    quadratic = whole.sum(frame.block_sums(system.x * system.f - fixed))
    if bounded is not None:
        gap = np.where(bounded, np.minimum(gap, 0.5 * np.abs(quadratic)), gap)
    terms, sizes = (frame.block_sums(values) for values in (fixed, np.abs(fixed)))
    # terms that cancel count where those of the dual cancel as well
    straight, sides = (whole.sum(np.where(at, sizes, 0.0)) for at in (parts.beside_z, ~parts.beside_z))
    prices = whole.sum(np.where(parts.beside_z, terms, 0.0))
    objective = np.maximum(np.abs(0.5 * quadratic + prices), 0.5 * np.abs(quadratic))
    objective = np.maximum(objective, np.minimum(straight, sides))
    size = np.maximum(objective, gap)
    error = np.divide(gap, size, out=np.zeros(gap.shape), where=gap > 0)
    if scales is not None:  # an objective of ε² of what data make it is 0
        given = np.multiply(*scales)
        of_zero = np.sqrt(np.divide(size, given, out=np.ones(gap.shape), where=size < given))
        objective, error = np.where(of_zero < error, given, objective), np.minimum(error, of_zero)
    without = whole.any(units.absolute)
    if some(without):
        by_itself = whole.sum(np.abs(products) * (units.x * units.f))
        if parts.measure is Measure.GAP:
            total = parts.of_problem(np.where(without, 0.0, objective))
            objective = np.where(without, total, objective)
            by_itself = np.minimum(by_itself, np.divide(gap, total, out=by_itself.copy(), where=total > 0))
        error = np.where(without, by_itself, error)
    return error, np.maximum(objective, gap)


def _each_row_once(system: System, parts: Parts, products: Vector) -> Vector:
    """Return the sizes of the products, those of a row that is given several times added up first.

    Such a row may have multipliers that cancel, as large as one likes, as an equality and an inequality or as two
    inequalities. It is known by its value, which is the same number to the last bit.
    """
    result = np.abs(products)
    (rows,) = np.nonzero(~parts.beside_z & (products != 0.0))
    if rows.size > 1:
        part = np.zeros(rows.size) if parts.whole.of is None else parts.whole.of[rows]
        values = system.frame.norms(system.f)[rows]
        order = np.lexsort((values, part))
        first = np.flatnonzero((np.diff(values[order], prepend=-1.0) != 0) | (np.diff(part[order], prepend=-1) != 0))
        result[rows] = 0.0
        result[rows[order[first]]] = np.abs(np.add.reduceat(products[rows[order]], first))
    return result


def _growth(
    system: System, parts: Parts, units: AnswerUnits, noise: Vector, errors: Vector, least: float
) -> tuple[Vector, Flags | None]:
    """Return the errors with sizes by the constants alone, and where rounding hides the constants (None: nowhere).

    No error grows by more than the units do; where its square would be no larger than what the answer has in any case,
    nothing is measured. (What a large coefficient of friction hides in the distances shows here only.)
    """
    frame = system.frame
    unit = parts.per_row * inverse(_sizes_of_constants(system, parts, units, noise))
    most = float(np.divide(unit, units.f, out=np.zeros(frame.k), where=units.f > 0).max(initial=0.0))
    hidden = noise * unit
    certain = not some(hidden * frame.amplification >= UNKNOWN)
    even = parts.measure is Measure.PAIRS or frame.even
    largest_error = float(errors.max(initial=0.0))
    if certain and even and most * largest_error <= np.sqrt(least or largest_error):
        return np.zeros(frame.k), None

    def measured(of: System) -> Vector:
        if parts.measure is Measure.PAIRS:
            return of.defect(frame.terms.effects(unit), unit)
        return frame.largest(of.excess(unit))

    grown = measured(_without_rounding(system, noise))
    if certain and parts.measure is Measure.PAIRS:
        return grown, None
    whole = measured(system)
    if parts.measure is not Measure.PAIRS:  # a distance changes by no more than what it is of
        grown = np.minimum(grown, np.maximum(whole - hidden, 0.0))
    if certain:
        return grown, None
    return grown, (hidden >= 1.0) | (whole - grown >= UNKNOWN)


def _sizes_of_constants(system: System, parts: Parts, units: AnswerUnits, noise: Vector) -> Vector:
    """Return what the constants alone make of the rows of every block, equilibrated.

    Loads move bodies as the drifts of contacts and joints do: of a contact problem all of these are one size. Sides of
    a program are no size where they are rounding, `noise` (k,), of what their rows add up, and of what prices make of
    the unknowns: a file has 1e-17 for 0.
    """
    whole, rows, sizes = parts.whole, parts.rows, units.constants
    if parts.measure is Measure.ENERGY:
        return whole.spread(whole.norm(sizes * parts.per_row))
    if some(system.fixed):
        sizes = np.maximum(sizes, system.frame.terms.sums(np.where(system.fixed, system.sizes, 0.0)))
    data = rows.spread(rows.largest(sizes * parts.per_row))
    if not parts.with_multipliers:
        return data
    of_part = (ROUNDINGS * EPS) * whole.spread(np.where(parts.curves, whole.largest(data), 0.0))
    of_rows = rows.spread(rows.largest(noise * parts.per_row))
    return np.where(data <= np.minimum(of_part, of_rows), 0.0, data)
