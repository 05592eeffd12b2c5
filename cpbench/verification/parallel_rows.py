"""Multipliers of parallel rows: what they cancel is no size of anything.

A row that is given twice, or as an inequality and an equality, has multipliers that may be as large as one likes and
cancel. A row of the dual that counted them would be met by every answer.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.matrices import Vector

LARGE = 10.0
"""Multipliers that add less than so many times what else is in each row of the dual cannot hide anything."""
DIGITS = 40
"""Bits in which entries of parallel rows agree."""
SAME = 1e-11


@dataclass(frozen=True, eq=False)
class ParallelRows:
    """The rows of a problem that have multipliers, as one CSR matrix."""

    rows: Any

    @cached_property
    def transposed(self) -> Any:
        """The same, by columns."""
        return sp.csr_array(self.rows.T)

    @cached_property
    def sizes(self) -> Any:
        """The sizes of the entries, by columns."""
        return abs(self.transposed)

    @cached_property
    def groups(self) -> tuple[Any, Vector, Any]:
        """The number of the group of each row, its length along the group, and the sizes of the first of each group."""
        rows = self.rows.copy()
        rows.eliminate_zeros()  # a zero that is stored first is no length of its row
        group, length = _groups(rows)
        first = np.full(int(group.max(initial=-1)) + 1, -1)
        first[group[::-1]] = np.arange(group.size)[::-1]
        return group, length, (np.abs(length[first]), sp.csr_array(abs(rows)[first].T))

    def relief(self, multipliers: Vector, rest: Vector) -> Vector | None:
        """Return Σ|A_ji||λ_j| less the same of the sums over parallel rows, for every unknown i; None where that is 0.

        `rest` are the sizes of the other terms: where multipliers add little to them, nothing is looked for.
        """
        if not multipliers.any():
            return None
        gross = self.sizes @ np.abs(multipliers)
        if not (gross > LARGE * rest).any():
            return None
        # a representative of each group stands for all of it, with the sum of what they push
        group, length, (lead, sizes) = self.groups
        summed = np.bincount(group, multipliers * length)
        return np.maximum(gross - sizes @ (np.abs(summed) / lead), 0.0)


def _groups(rows: Any) -> tuple[Any, Vector]:
    """Return the number of the group of parallel rows of each row, and the length of each along its group.

    Parallel rows have their entries in the same columns: most rows are seen to be alone by where theirs begin and end.
    """
    m = rows.shape[0]
    rows.sort_indices()
    lengths = np.diff(rows.indptr)
    filled = lengths > 0
    ends = np.full((3, m), -1)
    ends[0], ends[1, filled] = lengths, rows.indices[rows.indptr[:-1][filled]]
    ends[2, filled] = rows.indices[rows.indptr[1:][filled] - 1]
    order = np.lexsort(ends)
    same = (np.diff(ends[:, order], axis=1) == 0).all(axis=0)
    beside = np.zeros(m, dtype=bool)
    beside[order[:-1][same]] = beside[order[1:][same]] = True
    lead = np.ones(m)
    lead[filled] = rows.data[rows.indptr[:-1][filled]]
    group = np.arange(m)
    some = np.flatnonzero(beside)
    if some.size:
        group[some] = some[_first_parallel(rows[some], lead[some])]
    return np.unique(group, return_inverse=True)[1], lead


def _first_parallel(rows: Any, lead: Vector) -> Any:
    """Return the place of the first row that is parallel to each."""
    m, n = rows.shape
    # Parallel rows are equal once divided by their first entries. Mantissas and exponents are compared apart, so that
    # a column in other units changes nothing but an exponent, and that in all rows alike.
    entries = rows.data / np.repeat(np.where(lead != 0, lead, 1.0), np.diff(rows.indptr))
    mantissa, exponent = np.frexp(entries)
    mantissa = np.round(mantissa * 2.0**DIGITS) / 2.0**DIGITS
    full = np.abs(mantissa) == 1.0
    mantissa, exponent = np.where(full, mantissa / 2, mantissa), exponent + full
    weights = np.random.default_rng(20040917).standard_normal((3, n))[:, rows.indices]
    values = np.stack([np.ones_like(mantissa), mantissa, exponent]) * weights
    marks = np.stack([np.bincount(_row_of(rows), v, m) for v in values])
    sizes = np.stack([np.bincount(_row_of(rows), np.abs(v), m) for v in values])
    order = np.lexsort(marks)
    near = np.abs(np.diff(marks[:, order], axis=1)) <= SAME * sizes[:, order][:, 1:]
    starts = np.concatenate([[True], ~near.all(axis=0)])
    group = np.empty(m, dtype=np.int64)
    group[order] = np.cumsum(starts) - 1
    first = np.full(int(group.max()) + 1, m)
    np.minimum.at(first, group, np.arange(m))
    return first[group]


def _row_of(rows: Any) -> Any:
    return np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))
