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

    def contradicted(self, y: list[Any], t: Any, reach: list[Any]) -> None:
        """Raise ValueError unless the multipliers contradict the conditions for any x, and within t up to `reach`."""
        n, m = len(self.lo), len(self.rows)
        require(len(y) == m + len(self.equal) and len(reach) == n, "the multipliers are not those of the conditions")
        gain, size, nu, tau = fmpq(0), fmpq(0), [fmpq(0)] * n, [fmpq(0)] * n
        for i, ((row, side), v) in enumerate(zip([*self.rows, *self.equal], y, strict=True)):
            if v:
                require(side is not None and (i >= m or v > 0), "a multiplier has the wrong sign")
                gain, size = gain + v * side, size + abs(v * side)
                for j, entry in row.items():
                    nu[j], tau[j] = nu[j] - v * exact(entry), tau[j] + abs(v * exact(entry))
        rest, within, empty = gain, gain - t * size, False
        for j, (a, b, far) in enumerate(zip(nu, tau, reach, strict=True)):
            bound = self.lo[j] if a > 0 else self.hi[j]
            require(not a or bound is not None, "the multipliers leave an unknown without a bound")
            rest += 0 if bound is None else a * bound
            low, high = self._ends(j, t, far)
            empty = empty or low > high
            within -= max(t * b * abs(x) - a * x for x in (low, high))
        require(rest > 0, "the multipliers add up to no contradiction")
        require(empty or within > 0, "the contradiction has not the margin")

    def _ends(self, j: int, t: Any, far: Any) -> tuple[Any, Any]:
        """Return the interval of an unknown in all problems within t, by its bounds, its rows alone, and R."""
        low, high, lo, hi = -far, far, self.lo[j], self.hi[j]
        low = low if lo is None else max(low, lo - t * abs(lo))
        high = high if hi is None else min(high, hi + t * abs(hi))
        wide, narrow = (1 + t) / (1 - t), (1 - t) / (1 + t)
        for side, entry, equal in self._single.get(j, ()):
            v = side / entry
            if equal or entry > 0:
                low = max(low, v * (narrow if v > 0 else wide))
            if equal or entry < 0:
                high = min(high, v * (wide if v > 0 else narrow))
        return low, high

    @property
    def _single(self) -> dict[int, list[Any]]:
        if not hasattr(self, "_found"):
            self._found: dict[int, list[Any]] = {}
            for part, equal in ((self.rows, False), (self.equal, True)):
                for row, side in part:
                    if len(row) == 1 and side is not None:
                        [(j, entry)] = row.items()
                        self._found.setdefault(j, []).append((side, exact(entry), equal))
        return self._found

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
