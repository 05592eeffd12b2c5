"""The tableau of Lemke's method by columns: those that will probably enter next are updated by matrix products."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from scipy.linalg import blas

from cpbench.foundation.kernel_cache import load
from cpbench.foundation.matrices import Vector

BLOCKS = "cpbench_solvers.kernels.column_blocks"
BLOCK = 32
"""Pivots that are applied to several columns as one matrix product."""
FAR = 3
"""Blocks of pivots that an entering column may lack and still be brought up to date alone."""
LIKELY = 96
"""Columns that are brought up to date together with one that lacks more."""


Source: TypeAlias = Callable[[np.ndarray[Any, Any]], np.ndarray[Any, Any]]
"""Variables z_j -> the columns of -M that belong to them, row by row."""


class PivotingState:
    """The state of `pivoting.advance` on the LCP of M and q, and what brings many columns up to date at once.

    Parameters
    ----------
    columns : (n, n), row j is column j of M. q : (n,). factor : of M and q, -1/max|M|, so that they are of size one.
    source : where columns come from that are not stored; `columns` is then not read. likely : how many columns are
    brought together. room : for how many pivots, 0 for n.
    """

    def __init__(
        self,
        kernel: Any,
        columns: np.ndarray[Any, Any],
        q: Vector,
        *,
        factor: float = -1.0,
        source: Source | None = None,
        likely: int = LIKELY,
        block: int = BLOCK,
        room: int = 0,
    ) -> None:
        n = q.size
        self._kernel, self._n, self._block = kernel, n, block
        self._columns, self._factor, self._source, self._likely = columns, factor, source, likely
        # kept pivots take as much memory as the columns, rounded up to whole blocks
        room = -(-(room or n) // block) * block
        self._C = np.empty((n + 1, n))
        self._C[n] = -1.0
        self._age = np.append(np.full(n, -1 if source is None else kernel.UNKNOWN), 0)
        self._E, self._rows = np.empty((room, n)), np.empty(room, np.int64)
        self._rhs = q.copy()
        self._basic, self._nonbasic = np.arange(n), np.arange(n, 2 * n + 1)
        self._where = np.concatenate([-1 - np.arange(n), np.arange(n + 1)])
        first = int(q.argmin()) if source else kernel.first_row(columns.T, q, np.empty(n, np.int64))
        self._state = np.array([0, n, 0, first, n])
        self._workspace = np.empty(n, np.int64), np.empty(n)
        self._seen = (q.copy(), 0.0)

    @property
    def pivots(self) -> int:
        return int(self._state[2])

    @property
    def z(self) -> Vector:
        z = np.zeros(self._n)
        inside = (self._basic >= self._n) & (self._basic < 2 * self._n)
        z[self._basic[inside] - self._n] = np.maximum(self._rhs[inside], 0.0)
        return z

    @property
    def w(self) -> Vector:
        w = np.zeros(self._n)
        inside = self._basic < self._n
        w[self._basic[inside]] = np.maximum(self._rhs[inside], 0.0)
        return w

    def advance(self, limit: int, pivot_tolerance: float, tie_tolerance: float) -> int:
        columns = self._columns, self._factor, self._C, self._age, self._E, self._rows
        tableau = self._rhs, self._basic, self._nonbasic, self._where, self._state, *self._workspace
        return self._kernel.advance(*columns, *tableau, FAR * self._block, limit, pivot_tolerance, tie_tolerance)

    def bring_likely(self) -> None:
        """Bring the column that is asked for and those that will probably enter next, to the last whole block of
        pivots.

        A variable that leaves makes its complement enter, and it leaves where it reaches zero. As z_0 falls, the
        others move nearly on straight lines: seen from here and from the last time, they point at the next ones.
        """
        n, rhs, likely = self._n, self._rhs, self._likely
        before, z0_before = self._seen
        z0 = rhs[-1 - self._where[2 * n]]
        self._seen = (rhs.copy(), z0)
        slots = self._state[4:5]
        if z0 != z0_before:
            slope = (before - rhs) / (z0_before - z0)
            falls = slope > 0.0
            with np.errstate(over="ignore"):
                reaches_zero_at = np.where(falls, z0 - rhs / np.where(falls, slope, 1.0), -np.inf)
            reaches_zero_at[-1 - self._where[2 * n]] = -np.inf
            rows = np.argpartition(-reaches_zero_at, likely)[:likely] if n > likely else np.arange(n)
            basic = self._basic[rows]
            basic = basic[basic < 2 * n]
            others = self._where[np.where(basic < n, basic + n, basic - n)]
            slots = np.union1d(slots, others[others >= 0])
        self._bring(slots)

    def forget_pivots(self) -> None:
        """Bring every column up to date and begin a new list of pivots."""
        self._bring(np.arange(self._n + 1))
        self._state[0] = 0
        self._age[:] = 0

    def _bring(self, slots: np.ndarray[Any, Any]) -> None:
        block, blocks, E, rows = self._block, load(BLOCKS), self._E, self._rows
        end = int(self._state[0]) // block * block
        if self._source is not None:
            new = slots[self._age[slots] < 0]
            if new.size:
                self._C[new], self._age[new] = self._source(new), 0
        slots = slots[self._age[slots] < end]
        if slots.size == 0:
            return
        blocks.align(self._columns, self._factor, self._C, self._age, slots, E, rows, block)
        slots = slots[np.argsort(self._age[slots], kind="stable")]
        ages = self._age[slots]
        W = self._C[slots]
        t, x = np.empty((2, slots.size, block))
        for begin in range(int(ages[0]), end, block):
            count = int(np.searchsorted(ages, begin, side="right"))
            blocks.prepare(W, count, E, rows, begin, t, x)
            # W -= t E in place; BLAS wants columns, so on the transposes
            blas.dgemm(-1.0, E[begin : begin + block].T, t[:count].T, 1.0, W[:count].T, overwrite_c=True)
            blocks.restore(W, count, rows, begin, x)
        self._C[slots] = W
        self._age[slots] = end
