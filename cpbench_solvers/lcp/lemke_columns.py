"""The tableau of Lemke's method by columns, pivot by pivot; columns that are not stored come when they may enter."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from cpbench.foundation.matrices import Vector

Source: TypeAlias = Callable[[np.ndarray[Any, Any]], np.ndarray[Any, Any]]
"""Variables z_j -> the columns of -M that belong to them, row by row."""


class PivotingState:
    """The state of `pivoting.advance` on the LCP of M and q.

    Parameters
    ----------
    columns : (n, n), row j is column j of M. q : (n,). factor : of M and q, -1/max|M|, so that they are of size one.
    source : where columns come from that are not stored; `columns` is then not read. likely : how many of them come
    together. room : for how many pivots, 0 for n.
    """

    def __init__(
        self,
        kernel: Any,
        columns: np.ndarray[Any, Any],
        q: Vector,
        *,
        factor: float = -1.0,
        source: Source | None = None,
        likely: int = 1,
        room: int = 0,
    ) -> None:
        n = q.size
        self._kernel, self._n = kernel, n
        self._columns, self._factor, self._source, self._likely = columns, factor, source, likely
        self._C = np.empty((n + 1, n))
        self._C[n] = -1.0
        self._age = np.append(np.full(n, -1 if source is None else kernel.UNKNOWN), 0)
        self._E, self._rows = np.empty((room or n, n)), np.empty(room or n, np.int64)
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
        return self._kernel.advance(*columns, *tableau, limit, pivot_tolerance, tie_tolerance)

    def bring_likely(self) -> None:
        """Bring the column that is asked for and those that will probably enter next, as they are in M.

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
        new = slots[self._age[slots] == self._kernel.UNKNOWN]
        assert self._source is not None
        self._C[new], self._age[new] = self._source(new), 0

    def forget_pivots(self) -> None:
        """Bring every column up to date and begin a new list of pivots."""
        for slot in range(self._n + 1):
            self._kernel.update(
                *(self._columns, self._factor, self._C, self._age, slot, self._E, self._rows, int(self._state[0]))
            )
        self._state[0] = 0
        self._age[:] = 0
