"""Error of an answer to a linear or contact problem or a program, measured over connected parts of the problem.

Methods hold their conditions in norms: a row that is small beside its neighbours is as wrong as they are, and a
solution that decays has no digits of its own in its tail. Every connected part of the problem's matrix, for programs
[[Q, −Aᵀ], [A, 0]], is equilibrated, and has one size for its unknowns z, one for the rows beside z and one for those
beside the multipliers. With the rows f in these sizes, and every unknown by its largest effect on a row,

    pairs     error = max ‖x̂ − P(x̂ − f̂)‖ of complementarity problems and inequalities,
    contact   error = √Σ‖x̂ − P(x̂ − f̂)‖² over a part; with D = 1/√W_cc, sizes and error are in energy,
    programs  error = max(distance of x̂ from its set, distance of f̂ from the dual set, Σ products of x̂ and f̂).

The sum of products is the duality gap: a pair of which both are √ε is optimal to ε.

- No idle side, price or open contact sets a size: its constant counts as far as other terms of its row balance it.
  The multiplier of a bound that is written as a row is no such term, and no size of other rows: a bound that is a side
  of the set has none.
- Rows and unknowns of pairs may have no term in common (prices beside sides): each such system is a part.
- Small rows that no felt term couples to large ones are parts of their own (`coupling`).
- What no constant feeds but idle ones has the solution 0 and no size: it is measured absolutely. A part without an
  objective needs no multipliers.
- Unknowns that grow without bound would pass on problems without a solution, for they are in the sizes. So the square
  of what no answer may have (a row on the wrong side), over the constants of the part alone, must be within ε, too.
  That is strict where a solution's own multipliers are a million times the prices (QFORPLAN): a gradient that misses
  5e-9 of its terms misses 4 % of the prices there, and is wrong at 1e-6. Rounding of terms that cancel is taken off
  such a row, for the exact solution rounded to doubles leaves as much. Where that is `EXPLAINED` of the constants, or
  could be all of them, the answer would solve other constants as well, and it is `unresolvable`.
"""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.base import squared
from cpbench.matrices import Vector
from cpbench.verification.backward_error import EPS, ROUNDINGS, BackwardError
from cpbench.verification.coupling import felt_parts
from cpbench.verification.frame import Frame, System, inverse, largest
from cpbench.verification.parts import Measure, Parts
from cpbench.verification.sets import Flags, joined

HEARD = 0.1
"""Share of an idle constant that other terms of its row must reach for it to give a size."""
EXPLAINED = 0.1
"""Share of the constants of its part that is taken off a row as rounding, from which on the answer says nothing of
them."""
_PARTS: WeakKeyDictionary[Frame, Parts] = WeakKeyDictionary()


def parts_of(frame: Frame, measure: Measure) -> Parts:
    """Return the parts of a problem whose matrix is the same for every answer, found once."""
    if frame not in _PARTS:
        _PARTS[frame] = Parts.of(frame, frame.terms.rows, measure)
    return _PARTS[frame]


def parts_between(frame: Frame, other: Frame, measure: Measure) -> Parts:
    """Return the parts of a problem whose matrix depends on the point, by the larger of its entries at two of them.

    A derivative that vanishes at the answer says nothing of the units of its row and its unknown.
    """
    here, there = frame.terms.rows, other.terms.rows
    sizes = here.maximum(there) if np.isfinite(there.data).all() else here
    return Parts.of(frame, sp.csr_array(sizes), measure)


@dataclass(frozen=True, eq=False)
class _Units:
    """1/size of every block, of its unknowns and of its rows; 1/size of rows by constants alone."""

    x: Vector
    f: Vector
    data: Vector
    quiet: Flags
    absolute: bool


@dataclass(frozen=True, eq=False)
class BlockErrors:
    """Errors as `part_error` measures them, block by block and, of the components of blocks, one by one.

    Attributes
    ----------
    blocks : (k,) errors of blocks or of their parts. components : (N,) those of components, None where there are none.
    beyond : (N,) rows that no unknown may have. also : (rows,) residuals that must vanish beside f, None without any.
    floors : (k,) what rounding may cause. explained : (k,) whether it may be all that a row has.
    absolute : whether a part without constants was measured absolutely.
    """

    blocks: Vector
    components: Vector | None
    beyond: Vector
    also: Vector | None
    floors: Vector
    explained: Flags
    absolute: bool


def part_error(system: System, parts: Parts) -> BackwardError:
    """Measure an answer. Rows beside multipliers are those of the primal."""
    if not system.frame.k:
        return BackwardError(0.0, False, 0.0)
    sums = term_sums(system)
    if not np.isfinite(sums).all():  # squares of such unknowns are no numbers any more
        return BackwardError(np.inf, False, 0.0)
    found = block_errors(system, parts, sums)
    error = largest(*(float(a.max(initial=0.0)) for a in (found.blocks, found.components, found.also) if a is not None))
    error = largest(error, squared(largest(float(found.beyond.max(initial=0.0)))))
    return BackwardError(error, found.absolute, float(found.floors.max(initial=0.0)))


def term_sums(system: System) -> Vector:
    """Return the sums of the sizes of the terms of every row."""
    sums = system.frame.terms.sums(system.sizes())
    return sums if np.isscalar(system.relief) else np.maximum(sums - system.relief, 0.0)


def block_errors(system: System, parts: Parts, sums: Vector) -> BlockErrors:
    """Measure an answer whose `term_sums` are `sums`, all of them finite."""
    frame, sizes = system.frame, system.sizes()
    gross = sums + frame.constants
    fixed = system.fixed()
    held = fixed if frame.multiplier is None else fixed & ~frame.multiplier
    parts = felt_parts(parts, sizes, gross, held)
    units = _units(system, parts, sizes, sums, held)
    noise = (ROUNDINGS * EPS) * gross
    components = None
    if parts.measure is Measure.GAP:
        components, blocks, wrong = *_gap(system, parts, units), ~units.quiet
    else:
        blocks = frame.norms(system.defect(units.x, units.f))
        wrong = blocks != 0
        if parts.measure is Measure.ENERGY:
            blocks = parts.every.spread(parts.every.size(blocks)) + np.zeros(frame.k)
    also = None
    if system.also is not None:
        value, rows = system.also
        # the force of a bound has digits of its own row only
        size = np.maximum(1.0, frame.norms(system.f)[rows] * units.f[rows])
        also = np.abs(value) * units.f[rows] / size
    # beside a coefficient of 1/eps nothing is left of how fast a contact closes: 0 tells nothing there
    wrong |= (frame.amplification * EPS >= 1.0) & (frame.norms(system.f) > 0)
    floors = noise * units.f * frame.amplification * wrong
    excess, explained = beyond(system, noise, units.data)
    floors[explained] = np.maximum(floors[explained], EXPLAINED**2)
    return BlockErrors(blocks, components, excess, also, floors, explained, units.absolute)


def _gap(system: System, parts: Parts, units: _Units) -> tuple[Vector, Vector]:
    """Return the conditions of every pair, and the sum of the products of the part of every block."""
    frame = system.frame
    x_units, f_units = frame.spread(units.x), frame.spread(units.f)
    conditions, every = np.empty(frame.count), np.empty(frame.count)
    for part in frame.sets:
        conditions[part.place], every[part.place] = part.conditions(system.x, system.f, x_units, f_units)
    if parts.count == 1:
        return conditions, np.full(frame.k, every.sum())
    products: Vector = np.bincount(frame.spread(parts.part), every).astype(np.float64, copy=False)
    return conditions, products[parts.part]


def beyond(system: System, noise: Vector, data_unit: Vector) -> tuple[Vector, Flags]:
    """Return the rows that no unknown may have, over the constants, less what rounding leaves of terms that cancel; and
    of which blocks that explains the constants (`EXPLAINED`)."""
    frame = system.frame
    f = np.abs(system.f) - frame.spread(noise)
    f = np.copysign(np.maximum(f, 0.0, out=f), system.f)
    unit = frame.spread(data_unit)

    def excess(f: Vector) -> Vector:
        return joined(frame.sets, frame.count, lambda part: part.excess(f, unit))

    found, hidden = excess(f), noise * data_unit
    explained = hidden >= 1.0  # no digit of the constants is in the row
    if (hidden * frame.amplification >= EXPLAINED).any():
        less = np.maximum(excess(system.f), 0.0) - np.maximum(found, 0.0)
        explained |= frame.any(less >= EXPLAINED)
    return found, explained


def _units(system: System, parts: Parts, sizes: Vector, sums: Vector, held: Flags) -> _Units:
    """Return the sizes of the parts, as units of their blocks."""
    frame, z, multipliers = system.frame, parts.z, parts.multipliers
    constants, gap = frame.constants, parts.measure is Measure.GAP
    quiet = frame.any(joined(frame.sets, frame.count, lambda part: part.idle(system.x, system.f), bool))
    some_held = parts.every.any(held) if held.any() else np.zeros(parts.count, dtype=bool)

    # every z is as large as its part; without a side that is what the prices ask of a curved objective, idle prices
    # only where there are no others; else nothing
    prices, sides, curved = parts.prices, parts.sides, parts.curved
    tight = ~quiet & (constants > 0)
    sided = some_held | ((sides > 0) & multipliers.any(tight[multipliers.at]))  # idle sides give no size
    unsized = ~sided & ~((prices > 0) & curved)
    unpriced = unsized & (prices == 0)
    priced_by, bound = parts.bounding
    taken = None
    if bound.size:  # a bound that is a row takes its share of a price, as a side of the set does
        taken = np.bincount(priced_by, parts.bounding_terms * sizes[bound], frame.k)
        sums = np.maximum(sums - taken, 0.0)
        quiet = quiet | (frame.norms(system.f) < 0.5 * taken)
    balanced = (constants > 0) & (~quiet | (sums > HEARD * constants))
    priced = z.any(balanced[z.at])
    if parts.measure is not Measure.ENERGY:  # nor do idle prices that no other term of their row balances
        unheard = ~sided & ~priced
        unsized |= unheard
        unpriced |= unheard
    reach = prices
    if gap or frame.multiplier is not None:
        reach = z.size((sizes * parts.per_unknown)[z.at])
        asked = z.size((np.where(balanced, constants, 0.0) * parts.per_row)[z.at])
        reach = np.where(sided, reach, np.maximum(reach, np.where(asked > 0, asked, prices)))
    felt = np.where(unsized, 0.0, reach)
    data_unit = parts.data_unit
    if some_held.any():
        own = np.maximum(sides, z.size((np.where(held, sizes, 0.0) * parts.per_unknown)[z.at]))
        data_unit = data_unit.copy()
        data_unit[multipliers.at] = parts.per_row[multipliers.at] * multipliers.spread(inverse(own))

    weight, x_unit = np.zeros(frame.k), np.zeros(frame.k)
    empty = False
    for i, (group, least, plain) in enumerate(
        ((z, np.where(curved & gap, felt, 0.0), unpriced), (multipliers, felt, unsized))
    ):
        rows = group.at
        D, constant, feeds = parts.per_row[rows], constants[rows], sums[rows]
        if not D.size:
            continue
        counted = np.maximum(feeds, constant)
        heard = priced if group is z else group.any(balanced[rows])
        if not i and parts.measure is not Measure.ENERGY:  # sized unknowns make enough of a row
            heard = priced | (sided & curved & (felt > 0))
        if heard.any():
            counted = np.where(quiet[rows] & group.spread(heard), feeds, counted)
        # an entry of the equilibrated matrix is about 1: so much does a z of the part's size make of a row
        size = np.maximum(group.size(counted * D), least)
        empty = empty or not size.all()
        unit = group.spread(inverse(size))
        weight[rows] = D * unit
        if plain.any():
            weight[rows] = np.where(group.spread(plain), 1.0, weight[rows])
        if not parts.split:
            effect = parts.effects[i] * (unit if group is parts.every else parts.every.spread(inverse(size)))
            if plain.any():
                effect = np.where(parts.every.spread(plain), parts.plain_effects[i], effect)
            x_unit = np.maximum(x_unit, effect)
    if taken is not None:  # the force of a bound has digits of its own row only
        weight = np.divide(weight, weight * taken, out=weight, where=weight * taken > 1.0)
        x_unit[bound] = parts.bounding_terms * weight[priced_by]
    if parts.split:  # an unknown has effects on rows of other parts, too
        x_unit = frame.terms.effects(weight, np.ones(frame.k, dtype=bool))
    f_unit = np.where(weight > 0, weight, 1.0) if empty else weight
    # a set of finite size is data: an unknown beyond it is wrong even where no row feels that
    own = np.maximum(x_unit[z.at], frame.own_unit[z.at])
    if unsized.any():
        own = np.where(z.spread(unsized), 1.0, own)
    x_unit[z.at] = own if own.all() else np.where(own == 0, 1.0, own)
    moot = (prices == 0) & ~curved
    if frame.multiplier is not None and moot.any():
        f_unit[z.at] = np.where(z.spread(moot), 0.0, f_unit[z.at])
        x_unit[multipliers.at] = np.where(multipliers.spread(moot), 0.0, x_unit[multipliers.at])
    absolute = bool(unsized.any()) and bool((z.spread(unsized) & (sizes[z.at] > 0)).any())
    return _Units(x_unit, f_unit, data_unit, quiet, absolute)
