"""Connected parts of a problem, equilibrated: what belongs together, and in which units it is compared."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse.csgraph import connected_components

from cpbench.matrices import Vector, norm
from cpbench.verification.equilibration import equilibrate, equilibrate_apart
from cpbench.verification.frame import Frame
from cpbench.verification.sets import Flags, slice_of


class Measure(Enum):
    """What is summed over a part: nothing, the energy of its contacts, or the gap of its pairs."""

    PAIRS = "pairs"
    ENERGY = "energy"
    GAP = "gap"


@dataclass(frozen=True, eq=False)
class Parts:
    """The connected parts of a problem. Sizes of parts have the shape (count,).

    Attributes
    ----------
    frame : the problem. measure : what is summed over a part.
    per_row, per_unknown : (k,) equilibration: rows and unknowns of a part are compared times these.
    part : (k,) number of the part of each block. count : how many there are.
    inner : (k,) whether a row beside z has a term in some z.
    """

    frame: Frame
    measure: Measure
    per_row: Vector
    per_unknown: Vector
    part: Any
    count: int
    inner: Flags

    @classmethod
    def of(cls, frame: Frame, sizes: Any, measure: Measure) -> Parts:
        """Find them by the sizes of the problem's terms."""
        if measure is Measure.PAIRS:  # rows and unknowns may have units of their own
            rows, unknowns = equilibrate_apart(sizes)
        else:
            rows = unknowns = equilibrate(sizes + sizes.T)
        count, part = connected_components(sizes, directed=False)
        if frame.multiplier is None:
            inner = np.diff(sizes.indptr) > 0
        else:
            inner = ~frame.multiplier & (sizes @ (~frame.multiplier).astype(np.float64) > 0)
        return cls(frame, measure, rows, 1.0 / unknowns, part, int(count), inner)

    @cached_property
    def z(self) -> Any:
        """The blocks of z, beside those of the multipliers."""
        multiplier = self.frame.multiplier
        return slice(None) if multiplier is None else slice_of(np.flatnonzero(~multiplier))

    @cached_property
    def multipliers(self) -> Any:
        """The blocks of the multipliers."""
        multiplier = self.frame.multiplier
        return slice(0, 0) if multiplier is None else slice_of(np.flatnonzero(multiplier))

    @cached_property
    def curved(self) -> Flags:
        """Whether some z is in a row beside z."""
        return self.any(self.inner)

    @cached_property
    def prices(self) -> Vector:
        """Size of the constants of the rows beside z."""
        return self.size((self.frame.constants * self.per_row)[self.z], self.z)

    @cached_property
    def sides(self) -> Vector:
        """Size of the constants of the rows beside multipliers."""
        return self.size((self.frame.constants * self.per_row)[self.multipliers], self.multipliers)

    @cached_property
    def effects(self) -> tuple[Vector, Vector]:
        """The largest terms of every unknown in a row beside z, and in one beside a multiplier, per unit."""
        entries, found = self.frame.terms.rows, []
        scaled = entries.data * np.repeat(self.per_row, np.diff(entries.indptr))
        beside = np.ones(self.frame.k, dtype=bool) if self.frame.multiplier is None else ~self.frame.multiplier
        for rows in (beside, ~beside):
            largest = np.zeros(self.frame.k)
            if rows.all():
                np.maximum.at(largest, entries.indices, scaled)
            elif rows.any():
                some = np.repeat(rows, np.diff(entries.indptr))
                np.maximum.at(largest, entries.indices[some], scaled[some])
            found.append(largest)
        return found[0], found[1]

    def size(self, values: Vector, some: Any) -> Vector:
        """Size of the values of `some` blocks in every part; 0 where there is none."""
        energy = self.measure is Measure.ENERGY
        if self.count == 1:
            return np.array([norm(values) if energy else values.max(initial=0.0)])
        if energy:
            return np.sqrt(np.bincount(self.part[some], values * values, self.count))
        result = np.zeros(self.count)
        np.maximum.at(result, self.part[some], values)
        return result

    def any(self, flags: Flags, some: Any = slice(None)) -> Flags:
        """Whether any of `some` blocks of a part is flagged."""
        if self.count == 1:
            return np.array([flags.any()])
        return np.bincount(self.part[some], flags, self.count) > 0

    def spread(self, values: Any, some: Any = slice(None)) -> Any:
        """The values of parts, for `some` blocks."""
        return values[0] if self.count == 1 else values[self.part[some]]
