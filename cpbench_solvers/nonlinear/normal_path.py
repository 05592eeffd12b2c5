"""The normal map of a problem between bounds, F(P(x)) + x − P(x) (26), its cells, and the path to a zero of its
linearization, found by pivoting.

In a cell, where every xᵢ is below, between or above its bounds, the linearization A(x) = F(z) + M (P(x) − z) + x − P(x)
is affine with the matrix C whose column i is M's where xᵢ is between, and that of I elsewhere. From x⁰ the path is

    A(x) = (1 − t) A(x⁰),  t from 0 to 1 (Ralph 1994),

followed through the cells as Lemke's method follows its ray: one of x and t drives, the others depend on it; whatever
meets the border of its cell drives next. t falls on the way where neighbouring pieces have opposite orientation.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.foundation.cones import project_box
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Matrix, Vector, dense, identity, max_abs

REFRESH = 100
"""Pivots after which the basis is factorized again."""
PIVOT = 1e-11
"""Movements below this, over the largest, meet no border."""
PERTURBATIONS = (0.0, 1e-8, 1e-4)
"""Multiples of max|M| I added to M, one after the other, until the first basis is regular."""


def normal_point(z: Vector, F: Vector, lb: Vector, ub: Vector) -> Vector:
    """Return the x with P(x) = z whose normal map is least: x = z − F where F pushes z against its bound, else z."""
    pushed = ((z <= lb) & (F > 0)) | ((z >= ub) & (F < 0))
    return np.where(pushed, z - F, z)


def cell_matrix(M: Matrix, between: NDArray[np.bool_]) -> Matrix:
    """Return C: column i of M where xᵢ is between its bounds, of I elsewhere."""
    if sp.issparse(M):
        return sp.csr_array(M @ sp.diags_array(between.astype(float)) + sp.diags_array((~between).astype(float)))
    C = np.where(between, dense(M), 0.0)
    outside = np.flatnonzero(~between)
    C[outside, outside] = 1.0
    return C


def shifted(M: Matrix, share: float) -> Matrix:
    """Return M + share · max|M| I."""
    if share == 0.0:
        return M
    moved = M + share * (max_abs(M) or 1.0) * identity(M.shape[0], M)
    return sp.csr_array(moved) if sp.issparse(M) else np.asarray(moved)


@dataclass(frozen=True)
class Trace:
    """State of a path: x, t (1 at its end) and the number of pivots and of factorizations."""

    x: Vector
    t: float
    pivots: int
    factorizations: int


class _Basis:
    """B⁻¹ by one factorization and an eta vector for every column replaced since."""

    def __init__(self, B: Matrix) -> None:
        self._etas: list[tuple[int, Vector]] = []
        self._factors = Factorization(B)
        self.regular = not self._factors.singular

    @property
    def replaced(self) -> int:
        return len(self._etas)

    def solve(self, b: Vector) -> Vector:
        y: Vector = self._factors.solve(b)
        for p, w in self._etas:
            share = y[p] / w[p]
            y = y - share * w
            y[p] = share
        return y

    def replace(self, p: int, w: Vector) -> None:
        """Replace column p by the one of which w is B⁻¹."""
        self._etas.append((p, w))


class NormalPath:
    """The path of one linearization.

    Parameters
    ----------
    M, F : (n, n), (n,) at z = P(x). x : (n,) where it starts. lb, ub : (n,).
    """

    def __init__(self, M: Matrix, F: Vector, x: Vector, lb: Vector, ub: Vector) -> None:
        self._M, self._x, self._lb, self._ub = M, x, lb, ub
        self._r = F + x - project_box(x, lb, ub)

    def trace(self, until: float, most: int, deadline: float) -> Trace | None:
        """Follow the path until t reaches `until`, nothing meets a border any more, t is back at 0, or `most` pivots;
        None where no perturbation makes the first basis regular."""
        for share in PERTURBATIONS:
            walk = _Walk(shifted(self._M, share), self._r, self._x, self._lb, self._ub)
            result = walk.go(until, most, deadline)
            if result is not None:
                return result
        return None


class _Walk:
    def __init__(self, M: Matrix, r: Vector, x: Vector, lb: Vector, ub: Vector) -> None:
        n = x.size
        self._M: Matrix = sp.csc_array(M) if sp.issparse(M) else M  # pyright: ignore
        self._r, self._lb, self._ub = r, lb, ub
        self.n, self.x, self.t = n, np.append(x, 0.0), 0.0
        self.cell = np.where(x <= lb, -1, np.where(x >= ub, 1, 0))
        self.cell[(x <= lb) & (x >= ub)] = -1
        self.variable = np.arange(n)  # of every position of the basis; n is t
        self.factorizations = 0

    def go(self, until: float, most: int, deadline: float) -> Trace | None:
        n, x = self.n, self.x
        basis = self._factorized()
        if not basis.regular:
            return None
        driver, sign, pivots = n, 1.0, 0
        while pivots < most and not (pivots % 16 == 0 and time.monotonic() > deadline):
            w = basis.solve(self._column(driver))
            speed = -sign * w
            if not np.isfinite(speed).all():
                break
            length, position = self._first_border(speed, driver, sign, until)
            if not np.isfinite(length):
                break
            x[self.variable] += length * speed
            x[driver] += length * sign
            pivots += 1
            if position < 0:  # the driver itself has come to a border
                if driver == n:
                    break
                self._cross(driver, sign)
                continue
            leaving = int(self.variable[position])
            if leaving == n:
                break
            direction = float(np.sign(speed[position]))
            self._cross(leaving, direction)
            self.variable[position] = driver
            driver, sign = leaving, direction
            if basis.replaced >= REFRESH:
                basis = self._factorized()
                if not basis.regular:
                    break
            else:
                basis.replace(position, w)
        t = min(max(float(x[n]), 0.0), 1.0)
        return Trace(x[:n].copy(), t, pivots, self.factorizations)

    def _column(self, j: int) -> Vector:
        if j == self.n:
            return self._r
        if self.cell[j] == 0:
            if sp.issparse(self._M):
                column = np.zeros(self.n)
                a, b = self._M.indptr[j], self._M.indptr[j + 1]
                column[self._M.indices[a:b]] = self._M.data[a:b]
                return column
            return self._M[:, j]
        column = np.zeros(self.n)
        column[j] = 1.0
        return column

    def _factorized(self) -> _Basis:
        """Return factors of the present columns; r stands where t is basic."""
        self.factorizations += 1
        with_t = self.variable == self.n
        order = np.where(with_t, 0, self.variable)
        C = cell_matrix(self._M, self.cell == 0)[:, order]
        at = np.flatnonzero(with_t)
        if at.size:
            if sp.issparse(C):
                keep = sp.diags_array((~with_t).astype(float))
                rest = sp.csr_array((self._r, (np.arange(self.n), np.full(self.n, at[0]))), shape=C.shape)
                C = sp.csr_array(C @ keep + rest)
            else:
                C[:, at[0]] = self._r
        return _Basis(C)

    def _cross(self, j: int, direction: float) -> None:
        """Move x_j across the border that it is at, to stand on it exactly."""
        up = direction > 0
        if self.cell[j] == 0:
            self.cell[j] = 1 if up else -1
            self.x[j] = self._ub[j] if up else self._lb[j]
        else:
            self.x[j] = self._lb[j] if self.cell[j] < 0 else self._ub[j]
            # a fixed unknown has no room between its bounds
            self.cell[j] = -self.cell[j] if self._lb[j] == self._ub[j] else 0

    def _first_border(self, speed: Vector, driver: int, sign: float, until: float) -> tuple[float, int]:
        """Return how far the driver can go, and the position of what it meets then: −1 for its own border."""
        n = self.n
        low = np.append(np.where(self.cell < 0, -np.inf, np.where(self.cell > 0, self._ub, self._lb)), 0.0)
        high = np.append(np.where(self.cell > 0, np.inf, np.where(self.cell < 0, self._lb, self._ub)), until)
        at = self.x[self.variable]
        room = np.where(speed > 0, high[self.variable] - at, at - low[self.variable])
        size = np.abs(speed)
        with np.errstate(all="ignore"):
            length = np.where(size > PIVOT * max(1.0, size.max(initial=0.0)), np.maximum(room, 0.0) / size, np.inf)
        own = (high[driver] - self.x[driver]) if sign > 0 else (self.x[driver] - low[driver])
        best = float(length.min(initial=np.inf))
        if own <= best:
            return max(float(own), 0.0), -1
        ties = np.flatnonzero(length <= best + 1e-13 * max(1.0, best))
        ended = ties[self.variable[ties] == n]
        if ended.size:
            return best, int(ended[0])
        return best, int(ties[np.argmax(size[ties])])
