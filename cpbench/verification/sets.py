"""Sets of the unknowns of a problem, and what is measured of an answer in them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cpbench.foundation.matrices import Dense, Vector
from cpbench.foundation.product_cones import Cone, ProductCone
from cpbench.verification.projections import project, row_norms

Components = NDArray[np.int64]
Flags = NDArray[np.bool_]
INFINITE = 1e19
"""Bounds and sides from here on stand for none, as in most file formats."""
NEAR = 0.5
"""An unknown is at its bound where it is off by at most this share of it."""


def joined(parts: Sequence[Set], count: int, values: Callable[[Any], Any], dtype: type = np.float64) -> Any:
    """Return the values of all sets, each in its places."""
    if len(parts) == 1:
        return values(parts[0]).ravel()
    result = np.empty(count, dtype=dtype)
    for part in parts:
        result[part.place] = values(part)
    return result


@dataclass(frozen=True, eq=False)
class Box:
    """lb ≤ x ≤ ub of the components `at`, each a block of its own; answers are values in the places of all sets."""

    at: Components
    lb: Vector
    ub: Vector

    @classmethod
    def of(cls, at: Components, lb: Vector | float, ub: Vector | float) -> Box:
        """Make one, with sides from `INFINITE` on taken for infinite."""
        lower, upper = (np.broadcast_to(np.asarray(b, dtype=np.float64), at.shape) for b in (lb, ub))
        return cls(at, np.where(lower <= -INFINITE, -np.inf, lower), np.where(upper >= INFINITE, np.inf, upper))

    @cached_property
    def place(self) -> Any:
        """Where the unknowns are: a slice or their numbers."""
        return slice_of(self.at)

    @cached_property
    def bounded(self) -> tuple[Flags, Flags]:
        """Where the lower and the upper sides are finite."""
        return np.isfinite(self.lb), np.isfinite(self.ub)

    @cached_property
    def kind(self) -> str:
        """`free` without a side, `orthant` where all lower sides and no upper ones are finite, else `box`."""
        lower, upper = self.bounded
        if upper.any():
            return "box"
        return "orthant" if lower.all() else "box" if lower.any() else "free"

    @cached_property
    def moored(self) -> bool:
        """Whether a part of the boundary is not 0."""
        return any(((bound != 0) & some).any() for bound, some in zip((self.lb, self.ub), self.bounded, strict=True))

    @cached_property
    def free(self) -> Flags:
        """Whether a component may be anything."""
        lower, upper = self.bounded
        return ~lower & ~upper

    @cached_property
    def has_0(self) -> bool:
        """Whether 0 is in the set, so that the nearest point of it is never larger."""
        return bool((self.lb <= 0).all() and (self.ub >= 0).all())

    def nearest(self, x: Vector) -> Vector:
        """Return P(x) in the places of this set, x elsewhere; x itself where it is in the set."""
        own = x[self.place]
        if self.kind == "free" or (self.kind == "orthant" and bool((own >= self.lb).all())):
            return x
        result = x.copy()
        result[self.place] = np.minimum(np.maximum(own, self.lb), self.ub)
        return result

    def anchored(self, x: Vector) -> Flags:
        """Return whether a component is at, or beyond, a part of the boundary that is not 0."""
        own = x[self.place]
        result = np.zeros(own.size, dtype=bool)
        if self.moored:
            for bound, finite, beyond in zip(
                (self.lb, self.ub), self.bounded, (own <= self.lb, own >= self.ub), strict=True
            ):
                some = finite & (bound != 0)
                result |= some & (beyond | (np.abs(own - bound) <= NEAR * np.abs(bound)))
        return result

    def idle(self, x: Vector, f: Vector) -> Flags:
        """Return whether f holds a component on the boundary that it is at: only its sign matters."""
        w, own, (lower, upper) = f[self.place], x[self.place], self.bounded
        if self.kind == "orthant":
            return w > 0
        below, above = np.abs(own - self.lb), np.abs(own - self.ub)
        return (lower & (below <= above) & (w > 0)) | (upper & (above <= below) & (w < 0))

    def conditions(self, x: Vector, f: Vector, x_unit: Vector, f_unit: Vector) -> Vector:
        """Return the larger of the distances of x̂ from the set and of f̂ from the dual set."""
        w = f[self.place] * f_unit[self.place]
        if self.kind == "free":
            return np.abs(w)
        own, unit = x[self.place], x_unit[self.place]
        lower, upper = self.bounded
        below = np.where(lower, (self.lb - own) * unit, w)  # without a bound nothing may push towards it
        above = np.where(upper, (own - self.ub) * unit, -w)
        return np.maximum(np.maximum(below, above), 0.0)

    def products(self, x: Vector, f: Vector, reach: Vector, rounding: float) -> Vector:
        """Return x f, of boxes with x counted from the bound to which f pushes, at most `reach` and less by the share
        `rounding` of that."""
        w, own = f[self.place], x[self.place]
        bound = np.where(w > 0, self.lb, self.ub)
        room = np.where(np.isfinite(bound), own - bound, own)
        far = reach[self.place]
        return w * np.sign(room) * np.maximum(np.minimum(np.abs(room), far) - rounding * far, 0.0)

    def amplification(self) -> Vector:
        """Return by how much a rounding error of a row is larger in f; 1 or less but for a law with a large
        coefficient."""
        return np.ones(self.at.size)

    def own_unit(self) -> Vector:
        """Return 1 over the size of the set where that is finite, 0 elsewhere."""
        return _inverse_size(np.maximum(np.abs(self.lb), np.abs(self.ub)))

    def defect(self, x: Vector, f: Vector, x_unit: Vector, f_unit: Vector) -> Vector:
        """Return x̂ − P(x̂ − f̂); the set is measured in the units of its part."""
        step = f[self.place] * f_unit[self.place]
        if self.kind == "free":
            return step
        own, unit = x[self.place], x_unit[self.place]
        low, high = self.lb, self.ub
        if self.moored:  # a bound times a unit of 0 is no bound: 0·∞ would be NaN
            low, high = (np.where(some, unit * b, b) for b, some in zip((low, high), self.bounded, strict=True))
        at = own * unit
        missed = np.minimum(step, at - low)  # no difference of x̂ and x̂ − f̂: a small f is lost beside a large x
        return missed if self.kind == "orthant" else np.maximum(missed, at - high)


@dataclass(frozen=True, eq=False)
class ConeFactors:
    """Factors of one kind and size, each a block, with the methods of a `Box`; `rows` says that their rows f are in
    them, and −x in the normal cone.

    Attributes
    ----------
    kind : kind of the factors. at : (count, size) components. mu, mu_r : (count,) coefficients.
    """

    kind: Cone
    at: Components
    mu: Vector
    mu_r: Vector
    rows: bool = False

    @cached_property
    def place(self) -> Any:
        return self.at

    @cached_property
    def moored(self) -> bool:
        return self.kind in (Cone.CYLINDER, Cone.BALL) and not self.rows

    @cached_property
    def free(self) -> Flags:
        return np.zeros(self.at.shape, dtype=bool)

    @cached_property
    def has_0(self) -> bool:
        return True

    def nearest(self, x: Vector) -> Vector:
        if self.rows:
            return x
        result = x.copy()
        result[self.at] = project(self.kind, x[self.at], self.mu, self.mu_r)
        return result

    def anchored(self, x: Vector) -> Flags:
        if not self.moored:
            return np.zeros(self.at.shape, dtype=bool)
        part = x[self.at][:, 1:] if self.kind is Cone.CYLINDER else x[self.at]
        near = (self.mu > 0) & (row_norms(part) >= NEAR * self.mu)
        return np.broadcast_to(near[:, None], self.at.shape)

    def amplification(self) -> Vector:
        if self.kind in (Cone.CYLINDER, Cone.BALL):  # their μ is a radius
            return np.ones(self.at.shape)
        finite = np.where(np.isfinite(self.mu), self.mu, 0.0)
        return np.broadcast_to(1.0 + (finite + self.mu_r)[:, None], self.at.shape)

    def idle(self, x: Vector, f: Vector) -> Flags:
        # on the boundaries of both cones xᵀf is rounding, and its sign says nothing
        return np.broadcast_to((f[self.at] != 0).any(axis=1)[:, None], self.at.shape)

    def conditions(self, x: Vector, f: Vector, x_unit: Vector, f_unit: Vector) -> Vector:
        own, other = x[self.at] * x_unit[self.at], f[self.at] * f_unit[self.at]
        unit = x_unit[self.at[:, 0]]
        if self.rows:
            own, other, unit = other, own, f_unit[self.at[:, 0]]
        if self.kind in (Cone.CYLINDER, Cone.BALL):
            radius = self.mu * unit
            return self._of_each(row_norms(own - project(self.kind, own - other, radius, self.mu_r)))
        outside = row_norms(own - project(self.kind, own, self.mu, self.mu_r))
        # Moreau: the part of −y in K is what y lacks of being in the dual cone
        negative = row_norms(project(self.kind, -other, self.mu, self.mu_r))
        return self._of_each(np.maximum(np.maximum(outside, negative), 0.0 if self.rows else self._lacking(other)))

    def products(self, x: Vector, f: Vector, reach: Vector, rounding: float) -> Vector:
        own, other = (f[self.at], x[self.at]) if self.rows else (x[self.at], f[self.at])
        gap = np.einsum("ij,ij->i", own, other)
        if self.kind in (Cone.CYLINDER, Cone.BALL):  # their μ is a radius: the least of ⟨y, f⟩ over the set is below 0
            gap = gap + self.mu * row_norms(other[:, 1:] if self.kind is Cone.CYLINDER else other)
        result = np.zeros(self.at.shape)
        result[:, 0] = gap
        return result

    def _of_each(self, values: Vector) -> Any:
        """Return the numbers of factors, for each of their components."""
        return np.broadcast_to(values[:, None], self.at.shape)

    def _lacking(self, y: Dense) -> Vector | float:
        """Return what first components lack of being in the dual cones: of contacts, how fast they close.

        A large coefficient makes the distance to the cone as many times less, and hides that.
        """
        steep = np.isfinite(self.mu) & (self.mu > 1.0)
        if self.kind not in (Cone.SECOND_ORDER, Cone.ROLLING) or not steep.any():
            return 0.0
        found = np.zeros(len(y))
        y, mu = y[steep], self.mu[steep]
        k = y.shape[1] if self.kind is Cone.SECOND_ORDER else 1 + (y.shape[1] - 1) // 2
        needed = mu * row_norms(y[:, 1:k]) + self.mu_r[steep] * row_norms(y[:, k:])
        found[steep] = needed - y[:, 0]
        return found

    def own_unit(self) -> Vector:
        if self.kind is not Cone.BALL:
            return np.zeros(self.at.shape)
        return _inverse_size(np.broadcast_to(self.mu[:, None], self.at.shape))

    def defect(self, x: Vector, f: Vector, x_unit: Vector, f_unit: Vector) -> Vector:
        own, other = x[self.at] * x_unit[self.at], f[self.at] * f_unit[self.at]
        unit = x_unit[self.at[:, 0]]
        if self.rows:
            own, other, unit = other, own, f_unit[self.at[:, 0]]
        radius = self.mu * unit if self.kind in (Cone.CYLINDER, Cone.BALL) else self.mu
        return own - project(self.kind, own - other, radius, self.mu_r)


Set: TypeAlias = Box | ConeFactors


def of_product(K: ProductCone, first: int = 0, *, rows: bool = False) -> list[Set]:
    """Return the factors of a product whose components begin at `first`; with `rows`, the rows and not the unknowns
    are in K.

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
            found.append(ConeFactors(Cone(kind), at, K.mu[some], K.mu_r[some], rows))
    return found


def slice_of(at: Components) -> Any:
    """Return the same places as a slice, where they are one run."""
    if at.size and int(at[-1]) - int(at[0]) + 1 == at.size and (np.diff(at) == 1).all():
        return slice(int(at[0]), int(at[-1]) + 1)
    return at


def _inverse_size(size: Vector) -> Vector:
    """Return 1/size, 0 where the size is 0 or infinite."""
    return np.divide(1.0, size, out=np.zeros(size.shape), where=(size > 0) & np.isfinite(size))
