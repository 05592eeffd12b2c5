"""The linear conditions that every solution of a problem meets, and what contradicts them, over the rationals."""

from __future__ import annotations

from typing import Any

import numpy as np
from certificate_file import Matrix, exact, require
from flint import fmpq

INFINITE = 1e19
FREE, NONNEGATIVE, ZERO = 1, 2, 0
Row = dict[int, float]


class Conditions:
    """Rows ≥ sides, equal rows = their sides, lo ≤ x ≤ hi; None for a side or bound that is none."""

    def __init__(self, rows: list[tuple[Row, Any]], equal: list[tuple[Row, Any]], lo: Any, hi: Any) -> None:
        self.rows, self.equal = rows, equal
        self.lo, self.hi = [_finite(v, -1) for v in lo], [_finite(v, 1) for v in hi]

    def contradicted(self, y: list[Any], t: Any, sides: list[Any], bounds: list[Any], reach: list[Any]) -> None:
        """Raise ValueError unless the multipliers contradict the conditions for any x; and for all problems up to
        `reach` whose entries change by t of themselves, sides and bounds by t of themselves and of these sizes."""
        n, m = len(self.lo), len(self.rows)
        require(len(y) == len(sides) == m + len(self.equal), "the multipliers are not those of the conditions")
        require(
            len(bounds) == len(reach) == n and min([*sides, *bounds, *reach]) >= 0, "the sizes are not those of y, x"
        )
        gain, change, nu = fmpq(0), fmpq(0), [fmpq(0)] * n
        for i, ((row, side), v) in enumerate(zip([*self.rows, *self.equal], y, strict=True)):
            if v:
                require(side is not None and (i >= m or v > 0), "a multiplier has the wrong sign")
                gain, change = gain + v * side, change + abs(v) * (abs(side) + sides[i])
                for j, entry in row.items():
                    nu[j], change = nu[j] - v * exact(entry), change + abs(v * exact(entry)) * reach[j]
        for j, v in enumerate(nu):
            bound = self.lo[j] if v > 0 else self.hi[j]
            require(not v or bound is not None, "the multipliers leave an unknown without a bound")
            if v and bound is not None:
                gain, change = gain + v * bound, change + abs(v) * (abs(bound) + bounds[j])
        require(gain > 0, "the multipliers add up to no contradiction")
        require(gain > t * change, "the contradiction has not the margin")

    def feasible(self, x: list[Any]) -> None:
        """Raise ValueError unless x meets every condition."""
        inside = all(
            (a is None or v >= a) and (b is None or v <= b) for v, a, b in zip(x, self.lo, self.hi, strict=True)
        )
        rows = all(s is None or _dot(row, x) >= s for row, s in self.rows)
        require(inside and rows and all(_dot(row, x) == s for row, s in self.equal), "the point misses a condition")

    def recedes(self, d: list[Any]) -> None:
        """Raise ValueError unless d never leaves."""
        bounds = zip(d, self.lo, self.hi, strict=True)
        inside = all((a is None or v >= 0) and (b is None or v <= 0) for v, a, b in bounds)
        rows = all(s is None or _dot(row, d) >= 0 for row, s in self.rows)
        require(inside and rows and not any(_dot(row, d) for row, _ in self.equal), "the ray leaves the conditions")

    def optimality(self, Q: Matrix, p: Any) -> Conditions:
        """Return the conditions of (x, λ, μ, multipliers of lower and upper bounds) at a stationary point."""
        n, rows = len(self.lo), [row for row, side in self.rows if side is not None]
        equal = [dict(row) for row in Q.rows]
        low, high = ([j for j in range(n) if side[j] is not None] for side in (self.lo, self.hi))
        columns = [*rows, *(row for row, _ in self.equal), *({j: 1.0} for j in low), *({j: -1.0} for j in high)]
        for k, column in enumerate(columns):
            for j, entry in column.items():
                equal[j][n + k] = -entry
        lo = [-np.inf] * n + [0.0] * len(rows) + [-np.inf] * len(self.equal) + [0.0] * (len(low) + len(high))
        sides = [-exact(v) for v in p.tolist()]
        return Conditions([], list(zip(equal, sides, strict=True)), lo, [np.inf] * len(lo))


def conditions(node: str, d: dict[str, Any]) -> Conditions:
    """Return the linear conditions that every solution meets."""
    inf = np.inf
    if node == "lcp":
        n = d["q"].size
        return Conditions(_pairs(d["M"].rows, -d["q"]), [], np.zeros(n), np.full(n, inf))
    if node == "mlcp":
        n, m = d["a"].size, d["b"].size
        rows, equal = _beside(n, d["D"], d["B"]), _beside(n, d["A"], d["C"])
        lo = np.where(np.arange(n + m) < n, -inf, 0.0)
        return Conditions(_pairs(rows, -d["b"]), _pairs(equal, -d["a"]), lo, np.full(n + m, inf))
    if node == "qp":
        return Conditions(_pairs(d["A"].rows, d["b"]), _pairs(d["C"].rows, d["d"]), d["lb"], d["ub"])
    if node == "coneqp":
        kind = np.repeat(d["cone_kind"], d["cone_size"].astype(int)).tolist()
        require(set(kind) <= {FREE, NONNEGATIVE, ZERO}, "the cone is no polyhedron")
        both = _pairs(d["A"].rows, -d["b"])
        rows, equal = ([p for p, k in zip(both, kind, strict=True) if k == want] for want in (NONNEGATIVE, ZERO))
        free = np.full(d["p"].size, inf)
        return Conditions(rows, equal, -free, free)
    require(node in ("avi", "fc"), f"no conditions are known of {node}")
    return _avi(d) if node == "avi" else _contact(d)


def _avi(d: dict[str, Any]) -> Conditions:
    """Return those of (z, λ, μ): F = Mz + q − Aᵀλ − Cᵀμ is ≥ 0 (≤ 0) where z_j has a lower (an upper) bound only, 0
    without."""
    n, m, k = d["q"].size, d["b"].size, d["d"].size
    force = [dict(row) for row in d["M"].rows]
    for first, A in ((n, d["A"]), (n + m, d["C"])):
        for i, row in enumerate(A.rows):
            for j, entry in row.items():
                force[j][first + i] = -entry
    rows, equal = _pairs(d["A"].rows, d["b"]), _pairs(d["C"].rows, d["d"])
    low, high, q = d["lb"] > -INFINITE, d["ub"] < INFINITE, d["q"]
    for at, sign in ((low & ~high, 1.0), (high & ~low, -1.0)):
        there = np.flatnonzero(at)
        rows += _pairs([{i: sign * v for i, v in force[j].items()} for j in there.tolist()], -sign * q[there])
    there = np.flatnonzero(~low & ~high)
    equal += _pairs([force[j] for j in there.tolist()], -q[there])
    lo = np.concatenate([d["lb"], np.zeros(m), np.full(k, -np.inf)])
    return Conditions(rows, equal, lo, np.concatenate([d["ub"], np.full(m + k, np.inf)]))


def _contact(d: dict[str, Any]) -> Conditions:
    """Return u_N ≥ 0 and |r_T| ≤ μr_N by components."""
    n, nc = d["q"].size, d["mu"].size
    size = n // nc
    place = np.arange(n)
    normal, tangent = place[place % size == 0], place[place % size > 0].tolist()
    rows = _pairs([d["W"].rows[j] for j in normal.tolist()], -d["q"][normal])
    mu = d["mu"].tolist()
    for sign in (-1.0, 1.0):
        cone = [{size * (j // size): mu[j // size], j: sign} for j in tangent]
        rows += _pairs([{j: v for j, v in row.items() if v} for row in cone], np.zeros(len(tangent)))
    return Conditions(rows, [], np.where(place % size == 0, 0.0, -np.inf), np.full(n, np.inf))


def _beside(n: int, left: Matrix, right: Matrix) -> list[Row]:
    return [{**a, **{n + j: v for j, v in b.items()}} for a, b in zip(left.rows, right.rows, strict=True)]


def _pairs(rows: list[Row], sides: Any) -> list[tuple[Row, Any]]:
    return [(row, _finite(side, -1)) for row, side in zip(rows, sides.tolist(), strict=True)]


def _finite(value: float, sign: int) -> Any:
    """Return a bound as a rational, None where it stands for none: a lower one (sign −1) of −1e19 and less."""
    return None if sign * value >= INFINITE else exact(value)


def _dot(row: Row, x: list[Any]) -> Any:
    return sum((exact(v) * x[j] for j, v in row.items()), fmpq(0))
