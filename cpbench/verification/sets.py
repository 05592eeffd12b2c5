"""Sets of the unknowns of a problem, with the judge's own projections.

Nothing here is shared with what solves: a wrong projection there must not hide behind the same one here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cpbench.matrices import Dense, Vector
from cpbench.product_cones import Cone, ProductCone

Components = NDArray[np.int64]
INFINITE = 1e19
"""Bounds and sides from here on stand for none, as in most file formats."""


class Set(Protocol):
    """What some of the unknowns are in, blocks of them by themselves."""

    def nearest(self, x: Vector) -> Vector:
        """P(x) in the places of this set, x elsewhere."""
        ...

    def anchored(self, x: Vector) -> NDArray[np.bool_]:
        """Whether a component is at, or beyond, a part of the boundary that is not 0."""
        ...

    def own_unit(self, count: int) -> Vector:
        """1 over the size of the set where that is finite, 0 elsewhere; shape (count,)."""
        ...

    def idle(self, x: Vector, f: Vector) -> NDArray[np.bool_]:
        """Whether f holds a component on the boundary that it is at: only its sign matters."""
        ...

    def conditions(self, x: Vector, f: Vector, x_unit: Vector, f_unit: Vector) -> tuple[float, Vector]:
        """Largest of the distances of x̂ from the set and of f̂ from the dual set; and the products of both."""
        ...

    def amplification(self, x: Vector) -> Vector:
        """By how much a rounding error of a row is larger in f; 1 or less but for a law with a large coefficient."""
        ...

    def defect(self, x: Vector, f: Vector, x_unit: Vector, f_unit: Vector) -> Vector:
        """x̂ − P(x̂ − f̂) in the places of this set, 0 elsewhere; the set is measured in the units of its part."""
        ...


@dataclass(frozen=True, eq=False)
class Box:
    """lb ≤ x ≤ ub of the components `at`, each a block of its own."""

    at: Components
    lb: Vector
    ub: Vector

    @classmethod
    def of(cls, at: Components, lb: Vector | float, ub: Vector | float) -> Box:
        """With sides from `INFINITE` on taken for infinite."""
        lower, upper = (np.broadcast_to(np.asarray(b, dtype=np.float64), at.shape) for b in (lb, ub))
        return cls(at, np.where(lower <= -INFINITE, -np.inf, lower), np.where(upper >= INFINITE, np.inf, upper))

    def nearest(self, x: Vector) -> Vector:
        result = x.copy()
        result[self.at] = np.minimum(np.maximum(x[self.at], self.lb), self.ub)
        return result

    def anchored(self, x: Vector) -> NDArray[np.bool_]:
        result = np.zeros(x.size, dtype=bool)
        own = x[self.at]
        for bound, beyond in ((self.lb, own <= self.lb), (self.ub, own >= self.ub)):
            some = np.isfinite(bound) & (bound != 0)
            result[self.at] |= some & (beyond | (np.abs(own - bound) <= 0.5 * np.abs(bound)))
        return result

    def idle(self, x: Vector, f: Vector) -> NDArray[np.bool_]:
        result = np.zeros(x.size, dtype=bool)
        own, w = x[self.at], f[self.at]
        low = np.isfinite(self.lb) & (np.abs(own - self.lb) <= np.abs(own - self.ub)) & (w > 0)
        high = np.isfinite(self.ub) & (np.abs(own - self.ub) <= np.abs(own - self.lb)) & (w < 0)
        result[self.at] = low | high
        return result

    def conditions(self, x: Vector, f: Vector, x_unit: Vector, f_unit: Vector) -> tuple[float, Vector]:
        own, unit, w = x[self.at], x_unit[self.at], f[self.at] * f_unit[self.at]
        worst, products = 0.0, np.zeros(x.size)
        for bound, gap, push in ((self.lb, own - self.lb, w), (self.ub, self.ub - own, -w)):
            some = np.isfinite(bound)
            room = np.where(some, gap, 0.0) * unit
            pushed = np.maximum(push, 0.0)  # towards this bound: it is reached, or nothing pushes
            products[self.at] += np.minimum(pushed, 1.0) * np.clip(room, 0.0, 1.0)
            worst = float(np.max(np.where(some, -room, pushed), initial=worst))
        return worst, products

    def amplification(self, x: Vector) -> Vector:
        return np.ones(x.size)

    def own_unit(self, count: int) -> Vector:
        return _placed(self.at, np.maximum(np.abs(self.lb), np.abs(self.ub)), count)

    def defect(self, x: Vector, f: Vector, x_unit: Vector, f_unit: Vector) -> Vector:
        result = np.zeros(x.size)
        own, unit = x[self.at], x_unit[self.at]
        # a bound times a unit of 0 is no bound: 0·∞ would be NaN
        low, high = (np.where(np.isfinite(b), unit * b, b) for b in (self.lb, self.ub))
        at = own * unit
        result[self.at] = at - np.minimum(np.maximum(at - f[self.at] * f_unit[self.at], low), high)
        return result


@dataclass(frozen=True, eq=False)
class Factors:
    """Factors of one kind and size, each a block; `rows` says that their rows f are in them, and −x in the normal cone.

    Attributes
    ----------
    kind : kind of the factors. at : (count, size) components. mu, mu_r : (count,) coefficients.
    """

    kind: Cone
    at: Components
    mu: Vector
    mu_r: Vector
    rows: bool = False

    def nearest(self, x: Vector) -> Vector:
        if self.rows:
            return x
        result = x.copy()
        result[self.at] = project(self.kind, x[self.at], self.mu, self.mu_r)
        return result

    def anchored(self, x: Vector) -> NDArray[np.bool_]:
        result = np.zeros(x.size, dtype=bool)
        if self.kind in (Cone.CYLINDER, Cone.BALL) and not self.rows:
            part = x[self.at][:, 1:] if self.kind is Cone.CYLINDER else x[self.at]
            near = (self.mu > 0) & (_norms(part) >= 0.5 * self.mu)
            result[self.at] = near[:, None]
        return result

    def amplification(self, x: Vector) -> Vector:
        result = np.ones(x.size)
        if self.kind in (Cone.CYLINDER, Cone.BALL):  # their μ is a radius
            return result
        finite = np.where(np.isfinite(self.mu), self.mu, 0.0)
        result[self.at] = 1.0 + (finite + self.mu_r)[:, None]
        return result

    def idle(self, x: Vector, f: Vector) -> NDArray[np.bool_]:
        result = np.zeros(x.size, dtype=bool)
        own, other = x[self.at], f[self.at]
        held = np.einsum("ij,ij->i", own, other) > 0
        if self.rows:
            inside = (other == project(self.kind, other, self.mu, self.mu_r)).all(axis=1)
        else:  # Moreau: −f has no part in K where f is in the dual cone
            inside = (project(self.kind, -other, self.mu, self.mu_r) == 0).all(axis=1)
        open_ = (own == 0).all(axis=1) & (other != 0).any(axis=1) & inside
        result[self.at] = (held | open_)[:, None]
        return result

    def conditions(self, x: Vector, f: Vector, x_unit: Vector, f_unit: Vector) -> tuple[float, Vector]:
        own, other = x[self.at] * x_unit[self.at], f[self.at] * f_unit[self.at]
        unit, products = x_unit[self.at[:, 0]], np.zeros(x.size)
        if self.rows:
            own, other, unit = other, own, f_unit[self.at[:, 0]]
        if self.kind in (Cone.CYLINDER, Cone.BALL):
            radius = self.mu * unit
            return float(
                np.max(_norms(own - project(self.kind, own - other, radius, self.mu_r)), initial=0.0)
            ), products
        outside = _norms(own - project(self.kind, own, self.mu, self.mu_r))
        # Moreau: the part of −y in K is what y lacks of being in the dual cone
        negative = _norms(project(self.kind, -other, self.mu, self.mu_r))
        size = np.maximum(1.0, _norms(own)) * np.maximum(1.0, _norms(other))
        products[self.at[:, 0]] = np.abs(np.einsum("ij,ij->i", own, other)) / size
        return float(np.max(np.concatenate([outside, negative]), initial=0.0)), products

    def own_unit(self, count: int) -> Vector:
        if self.kind is not Cone.BALL:
            return np.zeros(count)
        return _placed(self.at, np.broadcast_to(self.mu[:, None], self.at.shape), count)

    def defect(self, x: Vector, f: Vector, x_unit: Vector, f_unit: Vector) -> Vector:
        result = np.zeros(x.size)
        own, other = x[self.at] * x_unit[self.at], f[self.at] * f_unit[self.at]
        unit = x_unit[self.at[:, 0]]
        if self.rows:
            own, other, unit = other, own, f_unit[self.at[:, 0]]
        radius = self.mu * unit if self.kind in (Cone.CYLINDER, Cone.BALL) else self.mu
        result[self.at] = own - project(self.kind, own - other, radius, self.mu_r)
        return result


def of_product(K: ProductCone, first: int = 0, *, rows: bool = False) -> list[Set]:
    """The factors of a product whose components begin at `first`; with `rows`, the rows and not the unknowns are in K.

    Components of {0}, ℝ and ℝ₊ are boxes of unknowns in both cases: the dual of each is one of them.
    """
    found: list[Set] = []
    start = np.concatenate([[0], np.cumsum(K.size)]).astype(np.int64)[:-1] + first
    for kind, size in sorted({(int(k), int(s)) for k, s in zip(K.kind, K.size, strict=True) if s > 0}):
        some = (K.kind == kind) & (K.size == size)
        at = start[some][:, None] + np.arange(size)
        if kind in (Cone.ZERO, Cone.FREE, Cone.NONNEGATIVE):
            lb, ub = {Cone.ZERO: (0.0, 0.0), Cone.FREE: (-np.inf, np.inf)}.get(Cone(kind), (0.0, np.inf))
            if rows and kind != Cone.NONNEGATIVE:
                lb, ub = (-np.inf, np.inf) if kind == Cone.ZERO else (0.0, 0.0)
            found.append(Box.of(at.ravel(), lb, ub))
        else:
            found.append(Factors(Cone(kind), at, K.mu[some], K.mu_r[some], rows))
    return found


def project(kind: Cone, y: Dense, mu: Vector, mu_r: Vector) -> Dense:
    """Euclidean projection of every row of y on its factor, shape (count, size)."""
    match kind:
        case Cone.SECOND_ORDER:
            return _second_order(y, mu)
        case Cone.ROLLING:
            return _rolling(y, mu, mu_r)
        case Cone.ROLLING_DUAL:  # Moreau: P_K*(y) = y + P_K(−y)
            return y + _rolling(-y, mu, mu_r)
        case Cone.CYLINDER:
            return np.column_stack([np.maximum(y[:, 0], 0.0), _cut(y[:, 1:], mu)])
        case Cone.BALL:
            return _cut(y, mu)
        case _:
            raise ValueError(f"{kind.name} is a box")


def _second_order(y: Dense, mu: Vector) -> Dense:
    """On {‖y_T‖ ≤ μ y_N}: the better of y itself, 0, and the foot on the ray through y_T; μ = ∞ is y_N ≥ 0."""
    n, t = y[:, 0], _norms(y[:, 1:])
    half_space = np.isinf(mu)
    slope = np.where(half_space, 0.0, mu)
    # the ray (cos a, sin a) with tan a = μ; its foot is the part of (n, t) along it
    cos = 1.0 / np.sqrt(1.0 + slope * slope)
    along = np.maximum((n + slope * t) * cos, 0.0)
    inside = (t <= slope * n) & (n >= 0)
    new_n = np.where(inside, n, along * cos)
    new_t = np.where(inside, t, along * slope * cos)
    new_n, new_t = np.where(half_space, np.maximum(n, 0.0), new_n), np.where(half_space, t, new_t)
    return np.column_stack([new_n, y[:, 1:] * _ratio(new_t, t)[:, None]])


def _rolling(y: Dense, mu: Vector, mu_r: Vector) -> Dense:
    """On {‖y_T‖ ≤ μ y_N, ‖y_M‖ ≤ μ_r y_N}: the largest of the feet r with each choice of active parts, and of 0.

    The derivative r − n − μ(t − μr)₊ − μ_r(m − μ_r r)₊ of half the squared distance is the least of the rising lines
    of the choices, so its root is the largest of theirs. Squared distances differ by too little to choose by.
    """
    k = (y.shape[1] - 1) // 2
    n, t, m = y[:, 0], _norms(y[:, 1 : 1 + k]), _norms(y[:, 1 + k :])
    best = np.zeros(len(y))
    for a in (0.0, 1.0):
        for b in (0.0, 1.0):
            best = np.maximum(best, (n + a * mu * t + b * mu_r * m) / (1.0 + a * mu**2 + b * mu_r**2))
    return np.column_stack([best, _cut(y[:, 1 : 1 + k], mu * best), _cut(y[:, 1 + k :], mu_r * best)])


def _cut(y: Dense, length: Vector) -> Dense:
    """Every row, no longer than its length."""
    size = _norms(y)
    return y * _ratio(np.minimum(size, length), size)[:, None]


def _norms(y: Dense) -> Vector:
    return np.sqrt(np.einsum("ij,ij->i", y, y))


def _placed(at: Components, size: Vector, count: int) -> Vector:
    """1/size in the places `at`, 0 elsewhere and where the size is 0 or infinite."""
    result = np.zeros(count)
    result[at] = np.divide(1.0, size, out=np.zeros(size.shape), where=(size > 0) & np.isfinite(size))
    return result


def _ratio(a: Vector, b: Vector) -> Vector:
    """a/b, 0 where b = 0."""
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0)
