"""Connected parts of a problem, equilibrated: what belongs together, and in which units it is compared."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from cpbench.foundation.matrices import Vector
from cpbench.verification.backward_error import EPS, ROUNDINGS
from cpbench.verification.equilibration import equilibrate, equilibrate_apart
from cpbench.verification.frame import Frame, every, largest_of


class Measure(Enum):
    """The measure of an error: pair by pair, in the energy of a part, or by the duality gap of a part."""

    PAIRS = "pairs"
    ENERGY = "energy"
    GAP = "gap"


@dataclass(frozen=True, eq=False)
class Groups:
    """Blocks in groups, with operations over each group; results have the shape (count,).

    Attributes
    ----------
    of : (k,) number of the group of each block, None where there is only one group. count : how many groups there are.
    k : how many blocks there are.
    """

    of: Any
    count: int
    k: int

    def largest(self, values: Vector) -> Vector:
        """Return the largest of the nonnegative values of each group; 0 for an empty group."""
        if self.of is None:
            return np.maximum.reduce(values, initial=0.0, keepdims=True)
        return largest_of(self.of, values, self.count)

    def sum(self, values: Vector) -> Vector:
        """Return the sum of the values of each group."""
        if self.of is None:
            return np.add.reduce(values, keepdims=True)
        return np.bincount(self.of, values, self.count).astype(np.float64, copy=False)

    def norm(self, values: Vector) -> Vector:
        """Return the Euclidean norm of the values of each group."""
        return np.sqrt(self.sum(values * values))

    def any(self, flags: Any) -> Any:
        """Return whether a block of the group is flagged."""
        if self.of is None:
            return np.logical_or.reduce(flags, keepdims=True)
        return np.bincount(self.of, flags, self.count) > 0

    def spread(self, values: Any) -> Any:
        """Return the value of its group, for each block; shape (k,)."""
        return values.repeat(self.k) if self.of is None else values[self.of]


@dataclass(frozen=True, eq=False)
class Parts:
    """The connected parts of a problem.

    Attributes
    ----------
    frame : the problem. measure : what is measured of a part.
    per_row : (k,) D of the equilibration: rows are compared times D.
    whole : the connected parts. rows : the groups of rows that share a size: within a part, rows beside multipliers
        apart from the others; of pairs, rows that are joined by the unknowns in them.
    problem : (whole.count,) the number of the problem that each part belongs to, where several are side by side.
    """

    frame: Frame
    measure: Measure
    per_row: Vector
    whole: Groups
    rows: Groups
    problem: Any = None

    @classmethod
    def of(cls, frame: Frame, sizes: Any, measure: Measure, problem: Any = None) -> Parts:
        """Find them by the sizes of the problem's terms; `problem` : (k,) number of the problem of each block, of
        several problems side by side."""
        part = connected(sizes)
        whole = _groups(part, frame.k)
        multiplier = frame.multiplier if frame.multiplier is not None and frame.multiplier.any() else None
        if measure is Measure.PAIRS:  # rows and unknowns may have units of their own
            per_row = equilibrate_apart(sizes, whole.of)[0]
            label = part if sizes.diagonal().all() else _rows_joined_by_unknowns(sp.csr_array(sizes))
        else:
            per_row, label = equilibrate(sizes + sizes.T, whole.of), part
        if multiplier is not None:
            label = 2 * (np.zeros(frame.k, np.int64) if label is None else label) + multiplier
        if problem is not None:
            own = np.zeros(whole.count, np.int64)
            own[0 if whole.of is None else whole.of] = problem[0] if whole.of is None else problem
            problem = own
        rows = whole if label is part else _groups(label, frame.k)
        return cls(frame, measure, per_row, whole, rows, problem)

    @cached_property
    def _bounds(self) -> Any:
        """The multipliers of rows with one entry, which are bounds, the rows beside their unknowns, and the entries."""
        terms, multiplier = self.frame.terms, self.frame.multiplier
        none = np.zeros(0, np.int64)
        if multiplier is None or self.measure is Measure.ENERGY:
            return none, none, np.zeros(0)
        bound = np.flatnonzero(multiplier & (terms.lengths == 1))
        if not bound.size:
            return none, none, np.zeros(0)
        bound = bound[~multiplier[terms.rows.indices[terms.rows.indptr[bound]]]]
        at = terms.rows.indptr[bound]
        return bound, terms.rows.indices[at], terms.rows.data[at]

    def by_bounds(self, sizes: Vector) -> Vector | None:
        """Return what the multipliers of bounds that are written as rows add to the rows beside z, (k,); None where no
        row is a bound."""
        bound, row, entries = self._bounds
        if not bound.size:
            return None
        return np.bincount(row, entries * sizes[bound], self.frame.k).astype(np.float64, copy=False)

    @cached_property
    def beside_z(self) -> Any:
        """Return whether the unknowns of a block are no multipliers; shape (k,)."""
        multiplier = self.frame.multiplier
        return np.ones(self.frame.k, dtype=bool) if multiplier is None else ~multiplier

    @cached_property
    def kinds(self) -> Groups | None:
        """Groups of rows, of pairs without multipliers those of free unknowns, which are equalities, apart from others;
        None where that makes no difference."""
        if self.measure is not Measure.PAIRS or self.with_multipliers:
            return None
        free = self.frame.any(self.frame.sets.free)
        if not free.any() or free.all():
            return None
        return _groups(2 * self.rows.spread(np.arange(self.rows.count)) + free, self.frame.k)

    def of_problem(self, values: Vector) -> Vector:
        """Return the sum of the values of parts over the problem of each part; shape (whole.count,)."""
        if self.problem is None:
            return values.sum().repeat(values.size)
        return np.bincount(self.problem, values).astype(np.float64, copy=False)[self.problem]

    @cached_property
    def one_size(self) -> bool:
        """Return whether all rows share one size."""
        return self.rows.of is None and not self.as_program and self.kinds is None

    @cached_property
    def effects(self) -> Vector:
        """The largest effect of every unknown on the rows, times D; shape (k,)."""
        return self.frame.terms.effects(self.per_row)

    @cached_property
    def with_multipliers(self) -> bool:
        """Return whether there are blocks of multipliers."""
        return self.frame.multiplier is not None and bool(self.frame.multiplier.any())

    @cached_property
    def as_program(self) -> bool:
        """Return whether rows beside z and rows beside multipliers are told apart: not in pairs without the latter."""
        return self.measure is Measure.GAP or self.with_multipliers

    def scales(self, needed: Any) -> tuple[Vector, Vector]:
        """Return the sizes that the sides and prices that are `needed` give z and the gradient of each part of a
        program.

        z is as large as the sides, or as prices make it where the objective is curved; a gradient is as large as
        prices, or as such a z makes it.
        """
        sizes = np.where(needed, self.frame.constants * self.per_row, 0.0)
        sides, prices = (self.whole.largest(np.where(at, sizes, 0.0)) for at in (~self.beside_z, self.beside_z))
        z = np.maximum(sides, np.where(self.curves, prices, 0.0))
        return z, np.maximum(prices, np.where(self.curves, z, 0.0))

    @cached_property
    def unpriced(self) -> Any:
        """Return whether a part of a program has rows beside z without constants, (whole.count,), but for rounding of
        what sides make of them; None where none is so."""
        if self.measure is not Measure.GAP:
            return None
        sizes = self.frame.constants * self.per_row
        prices, sides = (self.whole.largest(np.where(at, sizes, 0.0)) for at in (self.beside_z, ~self.beside_z))
        found = prices <= (ROUNDINGS * EPS) * np.where(self.curves, sides, 0.0)
        found &= self.whole.any(self.beside_z)
        return found if found.any() else None

    @cached_property
    def indifferent(self) -> Any:
        """Return whether a block is in a part that has neither prices nor a curved objective, (k,); None where none is.

        A row without entries is no such part: its multiplier pays for nothing in the objective of all.
        """
        if self.measure is not Measure.GAP:
            return None
        none = ~self.whole.any(self.beside_z & ((self.frame.constants > 0) | self.curved))
        found = self.whole.spread(none & self.whole.any(self.beside_z))
        return found if found.any() else None

    @cached_property
    def curved(self) -> Any:
        """Return whether a row beside z has a term in some z; shape (k,)."""
        return self.beside_z & (self.frame.terms.sums(self.beside_z.astype(np.float64)) > 0)

    @cached_property
    def curves(self) -> Any:
        """Return whether a part has such a row; shape (whole.count,)."""
        return self.whole.any(self.curved)


def _groups(label: Any, k: int) -> Groups:
    return Groups(None, 1, k) if label is None or not k else Groups(label, int(label.max()) + 1, k)


def _rows_joined_by_unknowns(sizes: Any) -> Any:
    """Return the group of each row, where an unknown joins the rows that have a term in it."""
    k = sizes.shape[0]
    indptr = np.concatenate([sizes.indptr, np.full(k, sizes.indptr[-1])])
    graph = sp.csr_array((sizes.data, sizes.indices + k, indptr), shape=(2 * k, 2 * k))
    return connected_components(graph, directed=False)[1][:k]


def connected(sizes: Any) -> Any:
    """Return the number of the connected part of each row; None where all are one."""
    if isinstance(sizes, np.ndarray) and sizes.size:  # mostly all are, and to see that is quick
        if every(sizes):
            return None
        joined, reached, count = (sizes > 0) | (sizes.T > 0), np.arange(sizes.shape[0]) == 0, 0
        while np.count_nonzero(reached) > count:
            count = np.count_nonzero(reached)
            reached |= joined[reached].any(axis=0)
        if count == reached.size:
            return None
    count, label = connected_components(sp.csr_array(sizes), directed=False)
    return None if count == 1 else label
