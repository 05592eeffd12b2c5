"""Lemke's method on a box-constrained linear problem, −(Kx + r) ∈ N_[lb,ub](x), from any basis.

A basis has the unknowns S that need not be at a bound, K_SS regular; the others are at one. Pairs of the dictionary are
the distance y of an unknown from its bound and its force w = ±(Kx + r), 0 ≤ y ≤ ub − lb; y is basic for S and w for
the others. Unknowns without a bound are in S, and leave the dictionary: w = 0 for them all the way (they are what is
eliminated). z_0 covers the rows that may be negative at first.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from cpbench.foundation.matrices import Dense, Vector, max_abs
from cpbench_solvers.kernels import bounded_pivoting

SLICE = 256
"""Pivots between two looks at the clock."""
SINGULAR = 1e-14
"""Reciprocal condition number of K_SS below which a basis is none."""
ROOM = 64
"""Least number of pivots that are kept before all columns are brought up to date."""


@dataclass(frozen=True)
class PivotOptions:
    """Options of lemke-avi, lemke-relay. `max_pivots` : 0 stands for 50n + 1000. `pivot_tolerance` : entries up to
    this, in data scaled to size one, do not block. `tie_tolerance` : rows that a step would bring this close to a
    bound count as tied."""

    max_pivots: int = 0
    pivot_tolerance: float = 1e-11
    tie_tolerance: float = 1e-13


@dataclass(frozen=True)
class Walk:
    """Result of a path: how it ended ("complementary", "ray", ...), x and unknowns of its last basis, the pivots."""

    outcome: str
    x: Vector
    inside: NDArray[np.bool_]
    pivots: int


@dataclass(frozen=True, eq=False)
class BoxLCP:
    """The problem: K (N, N), r, lb ≤ ub (N,), and which unknowns are multipliers of rows (N,)."""

    K: Dense
    r: Vector
    lb: Vector
    ub: Vector
    multiplier: NDArray[np.bool_]

    def walk(
        self, inside: NDArray[np.bool_], near: Vector, limit: int, deadline: float, options: PivotOptions
    ) -> Walk | None:
        """Walk from the basis S = `inside`, the others at the bound that is nearer to `near`; None where K_SS is
        singular or an unknown of S is out of bounds on both sides (z_0 cannot cover it)."""
        side, base = _sides(near, self.lb, self.ub)
        K, r = self.K * side[:, None] * side, side * (self.K @ base + self.r)
        S, rest = np.flatnonzero(inside), np.flatnonzero(~inside)
        solved = _regular_solve(K[np.ix_(S, S)], np.column_stack([K[np.ix_(S, rest)], r[S], np.eye(S.size)]))
        if solved is None:
            return None
        to_rest, at, inverse = solved[:, : rest.size], solved[:, rest.size], solved[:, rest.size + 1 :]
        # x_S = −K_SS⁻¹(r_S + K_SN x_N − w_S), and w_N with it
        D = np.empty((S.size + rest.size, S.size + rest.size))
        order = np.concatenate([S, rest])
        D[: S.size, : S.size], D[: S.size, S.size :] = inverse, -to_rest
        D[S.size :, : S.size] = K[np.ix_(rest, S)] @ inverse
        D[S.size :, S.size :] = K[np.ix_(rest, rest)] - K[np.ix_(rest, S)] @ to_rest
        d = np.concatenate([-at, r[rest] - K[np.ix_(rest, S)] @ at])
        width = self.ub - self.lb
        kept = np.flatnonzero((np.isfinite(self.lb) | np.isfinite(self.ub))[order])
        pairs = order[kept]
        basic = inside[pairs]
        cover = self.multiplier[pairs] == basic
        ray = _follow(D[np.ix_(kept, kept)], d[kept], cover, basic, width[pairs], limit, deadline, options)
        if ray is None:
            return None
        outcome, y, w, at_last, pivots = ray
        step, force = np.zeros(r.size), np.zeros(r.size)
        step[pairs], force[pairs] = y, w
        step[S] = -at - to_rest @ step[rest] + inverse @ force[S]
        now = inside.copy()
        now[pairs] = at_last
        return Walk(outcome, base + side * step, now, pivots)

    def refined(self, walk: Walk) -> Vector | None:
        """Return x of the last basis, from the data themselves; None where K_SS is singular."""
        _, base = _sides(walk.x, self.lb, self.ub)
        S = walk.inside
        x = np.where(S, 0.0, base)
        solved = _regular_solve(self.K[np.ix_(S, S)], (self.K @ x + self.r)[S][:, None])
        if solved is None:
            return None
        x[S] = -solved[:, 0]
        return np.clip(x, self.lb, self.ub)


def _sides(near: Vector, lb: Vector, ub: Vector) -> tuple[Vector, Vector]:
    """Return ±1, and the bound that y is counted from: the nearer one; 0 where there is none."""
    lower = np.isfinite(lb) & (~np.isfinite(ub) | (near - lb <= ub - near))
    side = np.where(lower | ~np.isfinite(ub), 1.0, -1.0)
    return side, np.where(lower, lb, np.where(np.isfinite(ub), ub, 0.0))


def _regular_solve(A: Dense, B: Dense) -> Dense | None:
    """Return A⁻¹B, None where A is singular to working precision."""
    if not A.size:
        return np.zeros(B.shape)
    size = float(np.abs(A).sum(axis=0).max())
    lu, pivots, info = lapack.dgetrf(A)
    if info != 0 or not lapack.dgecon(lu, size)[0] > SINGULAR:
        return None
    return lapack.dgetrs(lu, pivots, B)[0]


def _follow(
    D: Dense,
    d: Vector,
    cover: NDArray[np.bool_],
    basic: NDArray[np.bool_],
    width: Vector,
    limit: int,
    deadline: float,
    options: PivotOptions,
) -> tuple[str, Vector, Vector, NDArray[np.bool_], int] | None:
    """Return outcome, y, w, which y are basic in the end, and pivots; y is the basic one of the pairs `basic`."""
    kernel: Any = bounded_pivoting
    n = d.size
    rounding = 1e-9 * max(max_abs(d), 1e-300)
    narrow = basic & np.isfinite(width)
    if (narrow & ((d < -rounding) | (d > width + rounding))).any():
        return None
    cover = cover | (d < -rounding) & ~narrow
    d = np.where(cover, d, np.maximum(d, 0.0))
    d = np.where(basic, np.minimum(d, width), d)
    top, size = max_abs(D) or 1.0, max_abs(d) or 1.0
    # values over `size`; the columns of w, which D multiplies to values, are over top in turn
    free = np.full(n, np.inf)
    upper = np.concatenate([np.where(basic, width, free), np.where(basic, free, width), [np.inf]])
    scale = np.concatenate([np.full(n, size), np.full(n, size / top), [size]])
    negative = np.flatnonzero(cover & (d < 0.0))
    if not negative.size:
        return "complementary", np.where(basic, d, 0.0), np.where(basic, 0.0, d), basic.copy(), 0
    state = np.array([0, n, 0, negative[np.argmin(d[negative])]])
    rhs, upper = d / size, upper / scale
    rows, where = np.empty(n + ROOM, np.int64), np.concatenate([-1 - np.arange(n), np.arange(n + 1)])
    columns, age = np.empty((n + 1, n)), np.append(np.full(n, -1), 0)
    columns[n] = -cover.astype(float)
    row_of, slot_of, sign = np.arange(n), np.arange(n, 2 * n + 1), np.ones(n)
    arrays = (columns, age, np.empty((n + ROOM, n)), rows, rhs, upper, row_of, slot_of, where, sign, state)
    workspace = np.empty(n + 1, np.int64), np.empty(n + 1)
    matrix, most = np.ascontiguousarray(D / top), 0
    while True:
        most = min(limit, most + SLICE)
        outcome = kernel.follow(matrix, *arrays, *workspace, most, options.pivot_tolerance, options.tie_tolerance)
        if outcome != kernel.LIMIT or most == limit or time.monotonic() > deadline:
            break
    value = np.zeros(2 * n + 1)
    value[row_of] = rhs
    turned = np.tile(sign < 0, 2)
    flat = np.where(np.isfinite(upper[:-1]), upper[:-1], 0.0)
    value = np.where(turned, flat - value[:-1], value[:-1]) * scale[:-1]
    p, q = value[:n], value[n:]
    p_basic = where[:n] < 0
    words = {kernel.COMPLEMENTARY: "complementary", kernel.RAY: "ray", kernel.NOT_FINITE: "not finite"}
    word = words.get(outcome, "pivot limit" if most == limit else "out of time")
    now = np.where(basic, p_basic, where[n : 2 * n] < 0)
    return word, np.where(basic, p, q), np.where(basic, q, p), now, int(state[2])
