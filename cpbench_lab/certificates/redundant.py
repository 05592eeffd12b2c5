"""Equations that others imply exactly, and unknowns that may then be held: hyperstatic contact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from flint import arb, fmpq_mat
from scipy.linalg import qr

from cpbench.foundation.matrices import Dense, Sparse, Vector
from cpbench_lab.certificates.exact_rows import ExactRows, Index, rational, regular_part
from cpbench_lab.certificates.krawczyk import SmoothSystem


def implied(rows: Sparse, constants: Vector) -> list[int]:
    """Rows of rows·x + constants = 0 that follow from the others, exactly: over the rationals, no rounding."""
    count, width = rows.shape
    if not count:
        return []
    exact = ExactRows.of(sp.csr_array(rows))
    kept, columns = regular_part(exact, np.arange(count), np.arange(width), np.ones(width))
    dropped = np.setdiff1d(np.arange(count), kept)
    if not dropped.size:
        return []
    whole = np.column_stack([rows.toarray(), constants])
    own, other = _rationals(whole[kept]), _rationals(whole[dropped])
    square, sides = _rationals(whole[np.ix_(kept, columns)]), _rationals(whole[np.ix_(dropped, columns)])
    weights = square.transpose().solve(sides.transpose()).transpose()
    combined = (weights * own).tolist()
    return [int(i) for i, a, b in zip(dropped, combined, other.tolist(), strict=True) if a == b]


def _rationals(dense: Dense) -> Any:
    return fmpq_mat(*dense.shape, [rational(v) for v in dense.ravel().tolist()])


def with_held(held: Vector, columns: Index, x: Sequence[Any]) -> list[Any]:
    """Return all unknowns: x of the columns, and the values at which the others are held."""
    every = [arb(v) for v in held.tolist()]
    for j, value in zip(columns.tolist(), x, strict=True):
        every[j] = value
    return every


@dataclass(frozen=True, eq=False)
class ReducedSystem:
    """A system without some equations, and with some unknowns held.

    Attributes
    ----------
    whole : the system. rows : equations that are kept. columns : unknowns that are free. held : (N,) doubles, of which
    those of the others count.
    """

    whole: SmoothSystem
    rows: Index
    columns: Index
    held: Vector

    def full(self, x: Sequence[Any]) -> list[Any]:
        """Return all unknowns."""
        return with_held(self.held, self.columns, x)

    def residual(self, x: Sequence[Any]) -> list[Any]:
        """Return the rows that are kept."""
        rows = self.whole.residual(self.full(x))
        return [rows[i] for i in self.rows.tolist()]

    def jacobian(self, x: Sequence[Any]) -> tuple[Dense, Dense]:
        """Return the block of the rows that are kept and the unknowns that are free."""
        centre, spread = self.whole.jacobian(self.full(x))
        block = np.ix_(self.rows, self.columns)
        return centre[block], spread[block]


def reduced(system: SmoothSystem, dropped: Index, x: Vector, units: Vector, solved: Index) -> ReducedSystem:
    """Hold as many unknowns at the answer as equations are dropped, so that the rest is well conditioned.

    `solved` are equations that say what the unknowns of the same places are, which x holds already.
    """
    columns = np.setdiff1d(np.arange(x.size), solved)
    rows = np.setdiff1d(columns, dropped)
    if rows.size < columns.size:
        centre, _ = system.jacobian([arb(v) for v in x.tolist()])
        block = np.nan_to_num(centre[np.ix_(rows, columns)] * units[None, columns])
        top = np.abs(block).max(axis=1)
        order: Any = qr(block / np.where(top > 0, top, 1.0)[:, None], mode="r", pivoting=True, check_finite=False)[1]
        columns = np.sort(columns[np.asarray(order)[: rows.size]])
    return ReducedSystem(system, rows, columns, x)
