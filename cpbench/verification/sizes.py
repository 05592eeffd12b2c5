"""Sizes by which an answer is compared: one for the rows of a part, and for every unknown its largest effect on them.

`docs/methods/verdict.md` has the rules (units, constants), `Parts` the groups of rows that share a size. A part that no
constant sizes has the solution 0: its unknowns are compared as if of size 1, and each of its rows with its own terms.
The multiplier of a row with one entry balances no constant: the row is a bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.foundation.matrices import Vector
from cpbench.verification.backward_error import EPS, ROUNDINGS
from cpbench.verification.frame import System, every, inverse, some
from cpbench.verification.parts import Measure, Parts
from cpbench.verification.sets import Flags

BALANCED = 0.1
"""Share of an idle constant that the other terms of its row must reach for it to give a size."""


@dataclass(frozen=True, eq=False)
class AnswerUnits:
    """1/size of what an answer is compared by; every field has the shape (k,).

    Attributes
    ----------
    x, f : 1/size of the unknowns and of the rows of each block.
    absolute : whether the block is in a part that no constant sizes.
    needed : whether the constant of the row counts.
    constants : sizes of the constants of rows; of contact problems 0 where they are rounding of those that are needed.
    """

    x: Vector
    f: Vector
    absolute: Flags
    needed: Flags
    constants: Vector


def units_of(system: System, parts: Parts, sums: Vector) -> AnswerUnits:
    """Return the units of an answer; `sums` (k,) are Σ_j |J_ij||x_j|."""
    frame, constants = system.frame, system.frame.constants
    idle, taken = frame.any(frame.sets.idle(system.x, system.f)), parts.by_bounds(system.sizes)
    if taken is not None:
        sums = sums - taken
        idle = idle | (frame.norms(system.f) < 0.5 * taken)
    balanced = sums > BALANCED * constants
    needed = (constants > 0) & (balanced | ~idle)
    if parts.measure is Measure.ENERGY:  # a body at rest has 1e-16 for 0 where others move
        own, whole = constants * parts.per_row, parts.whole
        largest = whole.spread(parts.of_problem(whole.norm(np.where(needed, own, 0.0))))
        constants = np.where(own > ROUNDINGS * EPS * largest, constants, 0.0)
        needed &= constants > 0
    sized, known = _sized(system, parts, constants, needed, balanced)
    unit, size = _row_units(system, parts, constants, sums, needed, sized, known)
    if taken is not None:  # the force of a bound has digits of its own row only
        unit = np.minimum(unit, inverse(taken), out=unit, where=taken > 0)
    # a set of finite size is data: an unknown beyond it is wrong even where no row depends on it
    if parts.one_size and every(sized):
        effects = parts.effects / size
    else:
        effects = frame.terms.effects(np.where(sized, unit, 0.0))
    x = np.maximum(effects, frame.own_unit)
    x[(x == 0) | (~known & parts.beside_z)] = 1.0
    if parts.indifferent is not None:  # without an objective no multipliers are needed, and any will do
        unit[parts.indifferent & parts.beside_z] = 0.0
        x[parts.indifferent & ~parts.beside_z] = 0.0
    return AnswerUnits(x, unit, ~known, needed, constants)


def _sized(system: System, parts: Parts, constants: Vector, needed: Flags, balanced: Flags) -> tuple[Flags, Flags]:
    """Return whether the rows of each block have a size, and whether its unknowns have one."""
    frame, rows = system.frame, parts.rows
    fixed = system.fixed & parts.beside_z if frame.sets.moored else system.fixed
    gives = constants > 0 if parts.measure is Measure.ENERGY else needed
    if some(fixed):
        gives = gives | (frame.terms.sums(fixed.astype(float)) > 0)
    sized = rows.spread(rows.any(gives))
    if not parts.as_program:
        if every(sized):
            return sized, sized
        return sized, (frame.terms.effects(sized.astype(float)) > 0) | (frame.own_unit > 0)
    # sides size z; prices do where they are balanced by z itself, or by nothing; a load does, whatever bears it
    prices = needed & parts.beside_z
    if parts.measure is not Measure.ENERGY:
        prices &= ~balanced | (frame.terms.sums(parts.beside_z * system.sizes) > BALANCED * frame.constants)
    known = parts.whole.spread(parts.whole.any((~parts.beside_z & sized) | prices | fixed))
    return sized | (~parts.beside_z & known), known


def _row_units(
    system: System, parts: Parts, constants: Vector, sums: Vector, needed: Flags, sized: Flags, known: Flags
) -> tuple[Vector, Vector]:
    """Return 1/size of the rows of every block, and the size of its group, times D."""
    frame, rows, D = system.frame, parts.rows, parts.per_row
    sizes = system.sizes
    energy = parts.measure is Measure.ENERGY
    only_idle = ~rows.spread(rows.any(needed))
    counted = np.where(needed | only_idle, np.maximum(sums, constants), sums) * D
    by_group = sized
    if parts.as_program:  # an entry of the equilibrated matrix is about 1: so much does z make of a row
        own = sizes * inverse(D)
        if energy:  # what is at rest could move as fast as its loads make it
            reach = parts.whole.norm(np.where(parts.beside_z, np.maximum(own, constants * D), 0.0))
        else:
            reach = parts.whole.largest(np.where(parts.beside_z, own, 0.0))
        counted = np.where(known & ~parts.beside_z, np.maximum(counted, parts.whole.spread(reach)), counted)
        by_group = np.where(parts.beside_z, known, sized)
    size = rows.spread(rows.norm(counted) if energy else rows.largest(counted))
    if parts.kinds is not None:
        size = np.maximum(parts.kinds.spread(parts.kinds.largest(counted)), np.sqrt(EPS) * size)
    unit = np.divide(D, size, out=np.ones(frame.k), where=size > 0)
    if not every(by_group):
        least = np.maximum(sizes, np.where(known, inverse(frame.own_unit), 1.0))  # a box is a size
        least = np.where(parts.beside_z, least, 0.0)
        alone = np.maximum(frame.terms.sums(least), constants)
        unit = np.where(by_group, unit, np.divide(1.0, alone, out=np.ones(frame.k), where=alone > 0))
    return unit, size
