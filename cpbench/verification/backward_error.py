"""Componentwise backward error of an answer: the number that a verdict compares with the tolerance.

Every formulation is a list of unknowns x_c, each paired with a row f_c: x_c is in a set X_c and −f_c in its normal
cone there. A row is measured by the sum of the sizes of its terms, s_d = Σ_c |∂f_d/∂x_c||x_c| + |constant|, an unknown
by its largest effect on a row, E_c = max_d |∂f_d/∂x_c|/s_d, or by 1 over the size of X_c where that is finite and the
effect less. The error is the natural map in these units,

    error = max_c ‖x̂_c − P(x̂_c − f̂_c)‖,   x̂_c = E_c x_c,   f̂_c = f_c/s_c,   P the projection on E_c X_c.

A pair (x̂, f̂) is moved by that much to one that is exactly complementary; so the data, changed by at most that share
of every term, have an exact solution (Oettli and Prager 1964; Higham, Accuracy and Stability of Numerical Algorithms,
chapter 7).
The error is the same in all units of unknowns, rows and contacts, whatever stands beside, and in any order.

Rows without a constant need one more rule. Where all of their unknowns should be 0, an answer leaves 1e-12 in each, and
such a row has no size of its own. A row is therefore only as *definite* as what feeds it: a constant makes it
definite without limit, an unknown as far as it has an effect on another definite row. An error in a row counts up to
that, and so does an effect. What no constant feeds is homogeneous: 0 solves it, and it is measured absolutely.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.matrices import Vector
from cpbench.verification.sets import Set

Flags = NDArray[np.bool_]
EPS = float(np.finfo(np.float64).eps)
ROUNDINGS = 8.0
"""Roundings of the largest term that a sum may carry."""
PASSES = 200
"""Passes after which rows that still become more definite count as definite without limit."""


@dataclass(frozen=True, eq=False)
class Terms:
    """Sizes of the blocks of a Jacobian, rows and unknowns by block: as CSR and, for its columns, as CSC."""

    rows: Any
    columns: Any

    @classmethod
    def of(cls, sizes: Any) -> Terms:
        """Of a matrix of nonnegative sizes."""
        rows: Any = sp.csr_array(sizes)
        return cls(rows, sp.csc_array(rows))

    @classmethod
    def of_blocks(cls, matrix: Any, row_block: Any, column_block: Any) -> Terms:
        """Frobenius norms of the blocks of a matrix; the numbers of blocks rise from 0."""
        entries: Any = sp.coo_array(matrix)
        shape = (int(row_block[-1]) + 1 if len(row_block) else 0, int(column_block[-1]) + 1 if len(column_block) else 0)
        squares = sp.coo_array((entries.data**2, (row_block[entries.row], column_block[entries.col])), shape=shape)
        return cls.of(np.sqrt(sp.csr_array(squares)))

    def sums(self, sizes: Vector) -> Vector:
        """Σ_c terms_dc sizes_c of every row."""
        return np.asarray(self.rows @ sizes)

    def effects(self, weights: Vector, asked: Flags) -> Vector:
        """max_d terms_dc weights_d of every unknown that is asked for, 0 for others."""
        if 2 * np.count_nonzero(asked) > asked.size:
            return segment_max(self.columns.data * weights[self.columns.indices], self.columns.indptr)
        some = self.columns[:, np.flatnonzero(asked)]
        result = np.zeros(asked.size)
        result[asked] = segment_max(some.data * weights[some.indices], some.indptr)
        return result

    @cached_property
    def alone(self) -> Flags:
        """Whether an unknown is in no row."""
        return segment_max(self.columns.data, self.columns.indptr) == 0


@dataclass(frozen=True, eq=False)
class System:
    """An answer with the rows of its problem.

    Attributes
    ----------
    x, f : (N,) the unknowns and the values of the rows paired with them. block : (N,) the block of each, rising from 0.
    terms : sizes of the blocks of ∂f/∂x. constants : (k,) sizes of what else is in a row.
    sets : what the unknowns are in; together they hold every component once.
    relief : (k,) what multipliers of parallel rows that cancel add to the sums of `terms`.
    multiplier : (k,) whether an unknown only certifies others; without constants it may be anything.
    also : residuals that must vanish beside f, each with the blocks of the rows by which they are measured.
    """

    x: Vector
    f: Vector
    block: Any
    terms: Terms
    constants: Vector
    sets: Sequence[Set]
    relief: Vector | float = 0.0
    multiplier: Flags | None = None
    also: tuple[Vector, Any] | None = None


@dataclass(frozen=True)
class BackwardError:
    """`error` of the answer, whether a part without constants was measured absolutely, and what rounding may cause."""

    error: float
    absolute: bool
    floor: float


def backward_error(system: System) -> BackwardError:
    """Measure the answer of a system."""
    k = system.constants.size
    if not k:
        return BackwardError(0.0, False, 0.0)
    near, sizes, fixed = extents(system)
    scale = system.terms.sums(sizes) + system.constants
    scale = np.maximum(scale - system.relief, system.constants)
    if not np.isfinite(scale).all():  # squares of such unknowns are no numbers any more
        return BackwardError(np.inf, False, 0.0)
    definite = _definite(system, sizes, scale, fixed)
    homogeneous = (definite == 0) & (scale > 0)
    if system.multiplier is not None and homogeneous.any():  # multipliers alone: 0 certifies as well
        homogeneous &= system.terms.sums(np.where(system.multiplier, 0.0, sizes)) > 0
    outside = block_norms(system.x - near, system.block, k) > 0
    error = _measure(system, sizes, scale, definite, outside)
    if homogeneous.any():
        sure = np.where(homogeneous, np.inf, definite)
        relative = _measure(system, sizes, scale, sure, outside)
        by_itself = _measure(system, sizes, np.where(homogeneous, 1.0, scale), sure, outside, homogeneous)
        error = min(by_itself, relative)
    floor = EPS * (4.0 + np.diff(system.terms.rows.indptr).max(initial=0))
    return BackwardError(error, bool(homogeneous.any()), float(floor))


def extents(system: System) -> tuple[Vector, Vector, Flags]:
    """The nearest point of the sets, sizes of the unknowns that reach it, and which are at a bound that is not 0."""
    k = system.constants.size
    near, anchored = system.x, np.zeros(system.x.size, dtype=bool)
    for part in system.sets:
        near = part.nearest(near)
        anchored |= part.anchored(system.x)
    sizes = np.maximum(block_norms(system.x, system.block, k), block_norms(near, system.block, k))
    return near, sizes, by_block(anchored, system.block, k)


def beyond(system: System, gross: Vector, data: Vector) -> float:
    """The largest row that no unknown may have, over `data`, less what rounding leaves of terms that cancel."""
    noise = ROUNDINGS * EPS * gross[system.block]
    f = np.sign(system.f) * np.maximum(np.abs(system.f) - noise, 0.0)
    unit = inverse(data)[system.block]
    return largest(*(part.conditions(system.x, f, np.zeros_like(unit), unit)[0] for part in system.sets))


def _measure(
    system: System, sizes: Vector, scale: Vector, definite: Vector, outside: Flags, absolute: Flags | None = None
) -> float:
    """The largest natural map of a block; unknowns of `absolute` rows are measured by themselves."""
    f_unit = np.divide(1.0, scale, out=np.ones_like(scale), where=scale > 0)
    share = block_norms(system.f, system.block, scale.size) * f_unit
    sure = np.isfinite(definite)
    if sure.any():
        cut = np.divide(definite, share, out=np.ones_like(share), where=share > definite)
        f_unit = np.where(sure, f_unit * cut, f_unit)
    # inside its set, beside a row that is 0 to rounding, the unit of an unknown changes nothing
    asked = outside | (share > ROUNDINGS * EPS)
    x_unit = _units(system.terms, sizes, scale, definite, asked)
    if absolute is not None:
        x_unit = np.where(absolute, 1.0, x_unit)
    # a set of finite size is data: an unknown beyond it is wrong even where no row feels that
    for part in system.sets:
        np.maximum.at(x_unit, system.block, part.own_unit(system.x.size))
    x_units, f_units = x_unit[system.block], f_unit[system.block]
    defect = np.zeros(system.x.size)
    for part in system.sets:
        defect += part.defect(system.x, system.f, x_units, f_units)
    error = float(np.max(block_norms(defect, system.block, scale.size)))
    if system.also is not None:
        value, rows = system.also
        share = np.minimum(np.abs(value) * np.where(scale > 0, 1.0 / scale, 1.0)[rows], definite[rows])
        error = largest(error, float(np.max(share, initial=0.0)))
    return largest(error)


def _units(terms: Terms, sizes: Vector, scale: Vector, definite: Vector, asked: Flags) -> Vector:
    """E_c of the unknowns that are asked for: the largest effect on a row, per unit; 1 for one that no row has."""
    if not np.isfinite(definite).any():
        units = terms.effects(inverse(scale), asked)
    else:
        columns = terms.columns
        effect = columns.data * inverse(scale)[columns.indices]
        own = np.repeat(sizes, np.diff(columns.indptr))
        top = definite[columns.indices]
        some = own > 0
        effect[some] = np.minimum(effect[some], top[some] / own[some])
        effect[~some & (top == 0)] = 0.0
        units = segment_max(effect, columns.indptr)
    return np.where(terms.alone, np.divide(1.0, sizes, out=np.ones_like(sizes), where=sizes > 1.0), units)


def _definite(system: System, sizes: Vector, scale: Vector, fixed: Flags) -> Vector:
    """How definite every row is: ∞ with a constant or a fixed unknown, else as far as an unknown is that it has."""
    rows, columns = system.terms.rows, system.terms.columns
    definite = np.where(system.constants > 0, np.inf, 0.0)
    if ((definite > 0) | (scale <= 0)).all():
        return definite
    known = np.where(fixed & (sizes > 0), np.inf, 0.0)
    effect = columns.data * inverse(scale)[columns.indices] * np.repeat(sizes, np.diff(columns.indptr))
    some = (rows.data > 0) & (sizes[rows.indices] > 0)
    for _ in range(PASSES):
        unknowns = np.maximum(known, segment_max(np.minimum(effect, definite[columns.indices]), columns.indptr))
        risen = np.maximum(definite, segment_max(np.where(some, unknowns[rows.indices], 0.0), rows.indptr))
        if np.array_equal(risen, definite):
            return definite
        definite = risen
    return np.where(definite > 0, np.inf, definite)


def largest(*values: float) -> float:
    """The largest; ∞ where one is no number, which max() would drop."""
    found = float(np.max(values, initial=0.0))
    return found if np.isfinite(found) else np.inf


def inverse(x: Vector) -> Vector:
    """1/x, 0 where x is 0."""
    return np.divide(1.0, x, out=np.zeros_like(x), where=x > 0)


def segment_max(values: Vector, indptr: Any) -> Vector:
    """Largest of every segment of nonnegative values, 0 of an empty one."""
    result = np.zeros(len(indptr) - 1)
    filled = np.flatnonzero(np.diff(indptr))
    if filled.size:
        result[filled] = np.maximum.reduceat(values, indptr[:-1][filled])
    return result


def by_block(flags: Flags, block: Any, k: int) -> Flags:
    """Whether any component of a block is flagged."""
    return flags if k == flags.size else np.bincount(block, flags, k) > 0


def block_norms(x: Vector, block: Any, k: int) -> Vector:
    """Euclidean norm of every block."""
    if k == x.size:
        return np.abs(x)
    return np.sqrt(np.bincount(block, x * x, k))
