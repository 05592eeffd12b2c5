"""Connected parts of a problem, equilibrated: what belongs together, and in which units it is compared."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order, connected_components

from cpbench.matrices import Vector, norm
from cpbench.verification.equilibration import WHOLE, Sums, equilibrate, equilibrate_apart
from cpbench.verification.frame import Frame, inverse
from cpbench.verification.sets import Flags, slice_of


class Measure(Enum):
    """A quantity summed over a part: by pairs (none), the energy of its contacts, or the gap of its pairs."""

    PAIRS = "pairs"
    ENERGY = "energy"
    GAP = "gap"


@dataclass(frozen=True, eq=False)
class Group:
    """Parts of a problem, each of some of its blocks. Sizes of parts have the shape (count,).

    Attributes
    ----------
    at : where they are. part : the part of each, None where there is only one. count : how many parts there are.
    energy : whether the size of a part is the root of a sum of squares; else it is the largest of its blocks.
    """

    at: Any
    part: Any
    count: int
    energy: bool

    @cached_property
    def _runs(self) -> tuple[Any, Any, Any]:
        """The order in which blocks of a part stand together, where each part begins, and which parts there are."""
        order = np.argsort(self.part, kind="stable")
        found, starts = np.unique(self.part[order], return_index=True)
        return order, starts, found

    def size(self, values: Vector) -> Vector:
        """Size of the values in every part; 0 where there is none."""
        if not self.energy:
            return self.largest(values)
        if self.part is None:
            return np.array([norm(values)])
        return np.sqrt(np.bincount(self.part, values * values, self.count))

    def largest(self, values: Vector) -> Vector:
        """Return the largest of the values in every part; 0 where there is none."""
        if self.part is None:
            return np.array([values.max(initial=0.0)])
        result = np.zeros(self.count)
        if values.size:
            order, starts, found = self._runs
            result[found] = np.maximum.reduceat(values[order], starts)
        return result

    def any(self, flags: Flags) -> Flags:
        """Return whether a block of a part is flagged."""
        if self.part is None:
            return np.array([flags.any()])
        result = np.zeros(self.count, dtype=bool)
        result[self.part[flags]] = True
        return result

    def spread(self, values: Any) -> Any:
        """Return the values of parts, for every block."""
        return values[0] if self.part is None else values[self.part]


@dataclass(frozen=True, eq=False)
class Parts:
    """The connected parts of a problem.

    Attributes
    ----------
    frame : the problem. measure : what is summed over a part.
    per_row, per_unknown : (k,) equilibration: rows and unknowns of a part are compared times these.
    part : (k,) number of the part of each block, of pairs that of its row. count : how many there are.
    inner : (k,) whether a row beside z has a term in some z. split : whether terms couple parts that are apart.
    """

    frame: Frame
    measure: Measure
    per_row: Vector
    per_unknown: Vector
    part: Any
    count: int
    inner: Flags
    split: bool = False

    @classmethod
    def of(cls, frame: Frame, sizes: Any, measure: Measure, sums: Sums = WHOLE) -> Parts:
        """Find them by the sizes of the problem's terms; `sums` : of several problems side by side."""
        if measure is Measure.PAIRS:  # rows and unknowns may have units of their own, and prices go beside sides
            rows, unknowns = equilibrate_apart(sizes, sums)
            of_rows, of_unknowns = np.split(_rows_beside_unknowns(sizes), 2)
            split = bool((of_rows != of_unknowns).any())
            found, part = np.unique(of_rows, return_inverse=True)
            count = found.size
        else:
            rows = unknowns = equilibrate(sizes + sizes.T, sums)
            count, part = (1, np.zeros(frame.k, np.int64)) if _joined(sizes) else connected_components(sizes, False)
            split = False
        if frame.multiplier is None:
            inner = np.diff(sizes.indptr) > 0
        else:
            inner = ~frame.multiplier & (sizes @ (~frame.multiplier).astype(np.float64) > 0)
        return cls(frame, measure, rows, 1.0 / unknowns, part, int(count), inner, split)

    @cached_property
    def every(self) -> Group:
        """All blocks."""
        return self._group(slice(None))

    @cached_property
    def z(self) -> Group:
        """The blocks of z, beside those of the multipliers."""
        multiplier = self.frame.multiplier
        return self.every if multiplier is None else self._group(slice_of(np.flatnonzero(~multiplier)))

    @cached_property
    def multipliers(self) -> Group:
        """The blocks of the multipliers."""
        multiplier = self.frame.multiplier
        return self._group(slice(0, 0) if multiplier is None else slice_of(np.flatnonzero(multiplier)))

    def _group(self, at: Any) -> Group:
        return Group(at, None if self.count == 1 else self.part[at], self.count, self.measure is Measure.ENERGY)

    @cached_property
    def bounding(self) -> tuple[Any, Any]:
        """Rows beside unknowns with bounds that are rows, and the multipliers of these.

        Row and column of such a multiplier have one entry each, both of the same unknown.
        """
        none = np.zeros(0, dtype=np.int64)
        if self.measure is Measure.ENERGY:
            return none, none
        rows = self.frame.terms.rows
        lengths = np.diff(rows.indptr)
        if not (lengths == 1).any():
            return none, none
        columns = self.frame.terms.columns
        bound = np.flatnonzero((lengths == 1) & (np.diff(columns.indptr) == 1))
        row = columns.indices[columns.indptr[bound]]
        some = (row == rows.indices[rows.indptr[bound]]) & (row != bound) & (lengths[row] > 1)
        return row[some], bound[some]

    @cached_property
    def bounding_terms(self) -> Vector:
        """The entries of `bounding` in the rows that they bound."""
        columns = self.frame.terms.columns
        return columns.data[columns.indptr[self.bounding[1]]]

    @cached_property
    def curved(self) -> Flags:
        """Whether some z is in a row beside z."""
        return self.every.any(self.inner)

    @cached_property
    def prices(self) -> Vector:
        """Size of the constants of the rows beside z."""
        return self.z.size((self.frame.constants * self.per_row)[self.z.at])

    @cached_property
    def sides(self) -> Vector:
        """Size of the constants of the rows beside multipliers."""
        return self.multipliers.size((self.frame.constants * self.per_row)[self.multipliers.at])

    @cached_property
    def data_unit(self) -> Vector:
        """1/size of every row by the constants of its part."""
        result = np.zeros(self.frame.k)
        for group, size in ((self.z, self.prices), (self.multipliers, self.sides)):
            result[group.at] = self.per_row[group.at] * group.spread(inverse(size))
        return result

    @cached_property
    def effects(self) -> tuple[Vector, ...]:
        """The largest term of every unknown in rows beside z and in those beside multipliers, equilibrated."""
        return self._largest_terms(self.frame.terms.rows.data * self.per_row[self._row_of_entries])

    @cached_property
    def plain_effects(self) -> tuple[Vector, ...]:
        """The same of the terms as they are."""
        return self._largest_terms(self.frame.terms.rows.data)

    @property
    def _row_of_entries(self) -> Any:
        return np.repeat(np.arange(self.frame.k), np.diff(self.frame.terms.rows.indptr))

    def _largest_terms(self, values: Vector) -> tuple[Vector, ...]:
        at, k, multiplier = self.frame.terms.rows.indices, self.frame.k, self.frame.multiplier
        if multiplier is None:
            return largest_of(at, values, k), np.zeros(k)
        some = multiplier[self._row_of_entries]
        return largest_of(at[~some], values[~some], k), largest_of(at[some], values[some], k)


def _rows_beside_unknowns(sizes: Any) -> Any:
    """Return the part of each row, then of each unknown, where terms alone join them."""
    k = sizes.shape[0]
    if k and (sizes.nnz == k * k or (sizes.diagonal().all() and _joined(sizes))):
        return np.zeros(2 * k, dtype=np.int64)
    indptr = np.concatenate([sizes.indptr, np.full(k, sizes.indptr[-1])])
    graph = sp.csr_array((sizes.data, sizes.indices + k, indptr), shape=(2 * k, 2 * k))
    return connected_components(graph, directed=False)[1]


def _joined(sizes: Any) -> bool:
    """Return whether terms lead from the first row to all: most problems are one part, and to see that is quick."""
    k = sizes.shape[0]
    return bool(k) and breadth_first_order(sizes, 0, return_predecessors=False).size == k


def largest_of(at: Any, values: Vector, k: int) -> Vector:
    """Return the largest of the nonnegative values in each place."""
    result = np.zeros(k)
    np.maximum.at(result, at, values)
    return result
