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
- What no constant feeds has the solution 0 and no size: it is measured absolutely. A part without an objective needs
  no multipliers.
- Unknowns that grow without bound would pass on problems without a solution, for they are in the sizes. So the square
  of what no answer may have (a row on the wrong side), over the constants of the part alone, must be within ε, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from cpbench.formulations.base import Problem, squared
from cpbench.matrices import Vector, norm
from cpbench.verification.backward_error import (
    EPS,
    ROUNDINGS,
    BackwardError,
    System,
    beyond,
    block_norms,
    by_block,
    extents,
    inverse,
    largest,
)
from cpbench.verification.equilibration import equilibrate

Flags = NDArray[np.bool_]


class Measure(Enum):
    """What is summed over a part: nothing, the energy of its contacts, or the gap of its pairs."""

    PAIRS = "pairs"
    ENERGY = "energy"
    GAP = "gap"


@dataclass(frozen=True, eq=False)
class Parts:
    """The connected parts of a problem.

    Attributes
    ----------
    D, C : (k,) equilibration of the rows and of the unknowns; the same where the matrix is symmetric but for signs.
    part : (k,) number of the part of each block. count : how many there are.
    curved : (count,) whether some z is in a row beside z. measure : what is summed over a part.
    """

    D: Vector
    C: Vector
    part: Any
    count: int
    curved: Flags
    measure: Measure

    @classmethod
    def of(cls, sizes: Any, beside_z: Flags, measure: Measure) -> Parts:
        """Of the sizes of a problem's terms; `beside_z` are the blocks of z."""
        both, k = sizes + sizes.T, sizes.shape[0]
        count, part = connected_components(both, directed=False)
        curved = np.zeros(count, dtype=bool)
        inner = sizes[np.flatnonzero(beside_z)][:, np.flatnonzero(beside_z)]
        curved[part[beside_z][np.diff(inner.indptr) > 0]] = True
        if measure is Measure.PAIRS:  # rows and unknowns may have units of their own
            apart = equilibrate(sp.csr_array(sp.block_array([[None, sizes], [sizes.T, None]])))
            return cls(apart[:k], apart[k:], part, count, curved, measure)
        D = equilibrate(both)
        return cls(D, D, part, count, curved, measure)

    def size(self, values: Vector, some: Flags) -> Vector:
        """Size of the values of `some` blocks, for every block that of its part; 0 where there is none."""
        if self.count == 1:
            whole = norm(values[some]) if self.measure is Measure.ENERGY else float(values.max(initial=0.0, where=some))
            return np.full(values.size, whole)
        result = np.zeros(self.count)
        if self.measure is Measure.ENERGY:
            result += np.sqrt(np.bincount(self.part[some], values[some] ** 2, self.count))
        else:
            np.maximum.at(result, self.part[some], values[some])
        return result[self.part]

    def any(self, flags: Flags) -> Flags:
        """Whether any block of the part is flagged, for every block."""
        if self.count == 1:
            return np.full(flags.size, flags.any())
        return (np.bincount(self.part, flags, self.count) > 0)[self.part]


_PARTS: WeakKeyDictionary[Problem, Parts] = WeakKeyDictionary()


def parts_of(problem: Problem, system: System, measure: Measure) -> Parts:
    """The parts of a problem whose matrix is the same for every answer, found once."""
    if problem not in _PARTS:
        _PARTS[problem] = Parts.of(system.terms.rows, beside_z(system), measure)
    return _PARTS[problem]


def parts_between(system: System, other: System, measure: Measure) -> Parts:
    """The parts of a problem whose matrix depends on the point, by the larger of its entries at two of them.

    A derivative that vanishes at the answer says nothing of the units of its row and its unknown.
    """
    here, there = system.terms.rows, other.terms.rows
    sizes = here.maximum(there) if np.isfinite(there.data).all() else here
    return Parts.of(sp.csr_array(sizes), beside_z(system), measure)


def beside_z(system: System) -> Flags:
    """The blocks of z, beside those of the multipliers."""
    k = system.constants.size
    return np.ones(k, dtype=bool) if system.multiplier is None else ~system.multiplier


@dataclass(frozen=True, eq=False)
class _Units:
    """1/size of every block, of its unknowns and of its rows; sizes of rows by constants alone, and by all terms."""

    x: Vector
    f: Vector
    data: Vector
    gross: Vector
    quiet: Flags
    absolute: bool


def part_error(system: System, parts: Parts) -> BackwardError:
    """Measure an answer. Rows beside multipliers are those of the primal."""
    if not system.constants.size:
        return BackwardError(0.0, False, 0.0)
    units = _units(system, parts)
    x_units, f_units = units.x[system.block], units.f[system.block]
    if not np.isfinite(units.gross).all():  # squares of such unknowns are no numbers any more
        return BackwardError(np.inf, units.absolute, 0.0)
    unbound = beyond(system, units.gross, units.data)
    noise = ROUNDINGS * EPS * units.gross[system.block]
    defect = np.where(units.quiet[system.block], 0.0, 1.0)
    if parts.measure is not Measure.GAP:
        defect = sum(part.defect(system.x, system.f, x_units, f_units) for part in system.sets)
        norms = block_norms(defect, system.block, system.constants.size)
        error = float(norms.max())
        if parts.measure is Measure.ENERGY:
            error = float(np.sqrt(np.bincount(parts.part, norms**2).max()))
    else:
        error, products = 0.0, np.zeros(system.x.size)
        for part in system.sets:
            worst, own = part.conditions(system.x, system.f, x_units, f_units)
            error, products = largest(error, worst), products + own
        error = largest(error, float(np.bincount(parts.part[system.block], products).max()))
    error = largest(error, squared(unbound))
    if system.also is not None:
        value, rows = system.also
        error = largest(error, float(np.max(np.abs(value) * units.f[rows], initial=0.0)))
    amplified = np.ones(system.x.size)
    for part in system.sets:
        amplified = np.maximum(amplified, part.amplification(system.x))
    floor = float(np.max(noise * f_units * amplified * (defect != 0), initial=0.0))
    return BackwardError(largest(error), units.absolute, floor)


def _units(system: System, parts: Parts) -> _Units:
    k, D, constants = system.constants.size, parts.D, system.constants
    multipliers = np.zeros(k, dtype=bool) if system.multiplier is None else system.multiplier
    z = ~multipliers
    _, sizes, fixed = extents(system)
    idle, own_unit = np.zeros(system.x.size, dtype=bool), np.zeros(k)
    for part in system.sets:
        idle |= part.idle(system.x, system.f)
        np.maximum.at(own_unit, system.block, part.own_unit(system.x.size))
    quiet = by_block(idle, system.block, k)
    held = z & fixed

    # every z is as large as its part; without a side that is what the prices ask of a curved objective, else nothing
    sided = parts.any(held | (multipliers & (constants > 0)))
    prices = parts.size(constants * D, z)
    curved = parts.curved[parts.part]
    unsized = ~sided & ~((prices > 0) & curved)
    reach = parts.size(sizes / parts.C, z)
    reach = np.where(sided, reach, np.maximum(reach, prices))
    # where z = 0 balances all, idle sides are all that has a size
    idle_only = sided & ~parts.any(~quiet & (constants > 0)) & ~parts.any(held)
    reach = np.where(idle_only, np.maximum(reach, parts.size(constants * D, multipliers)), reach)
    sums = np.maximum(system.terms.sums(sizes) - system.relief, 0.0)

    scale, data = np.zeros(k), np.zeros(k)
    for rows, felt in ((z, curved & (parts.measure is Measure.GAP)), (multipliers, np.ones(k, dtype=bool))):
        feeds = np.where(rows, sums, 0.0)
        heard = parts.any(rows & (constants > 0) & (~quiet | (feeds > 0.1 * constants)))
        counted = np.where(quiet & heard, np.minimum(constants, feeds), constants)
        size = parts.size(np.maximum(feeds, counted) * D, rows)
        # an entry of the equilibrated matrix is about 1: so much does a z of the part's size make of a row
        size = np.maximum(size, np.where(felt & ~unsized, reach, 0.0))
        scale = np.where(rows, size / D, scale)
        own = parts.size(constants * D, rows)
        if rows is multipliers:
            own = np.maximum(own, parts.size(np.where(held, sizes, 0.0) / parts.C, z))
        data = np.where(rows, own / D, data)
    scale = np.where(unsized & (multipliers | (prices == 0)), 1.0, scale)

    f_unit = np.where(scale > 0, inverse(scale), 1.0)
    x_unit = system.terms.effects(inverse(scale), np.ones(k, dtype=bool))
    # a set of finite size is data: an unknown beyond it is wrong even where no row feels that
    x_unit = np.where(z, np.maximum(x_unit, own_unit), x_unit)
    x_unit = np.where(z & ((x_unit == 0) | unsized), 1.0, x_unit)
    moot = (prices == 0) & ~curved
    f_unit = np.where(moot & z & multipliers.any(), 0.0, f_unit)
    x_unit = np.where(moot & multipliers, 0.0, x_unit)
    return _Units(x_unit, f_unit, data, sums + constants, quiet, bool((unsized & (sizes > 0) & z).any()))
