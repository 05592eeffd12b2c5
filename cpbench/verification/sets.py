"""Sets of the unknowns of a problem, and what is measured of an answer in them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.foundation.cones import Cone, ProductCone
from cpbench.foundation.matrices import Dense, Vector
from cpbench.verification.projections import project, row_norms

Components = NDArray[np.int64]
Flags = NDArray[np.bool_]
INFINITE = 1e19
"""Bounds and sides from here on stand for none, as in most file formats."""
NEAR = 0.5
"""An unknown is at its bound where it is off by at most this share of it."""


@dataclass(frozen=True, eq=False)
class Sets:
    """Sets of the unknowns of a problem: lb ≤ x ≤ ub, each component by itself, but for those of `cones`.

    Answers are values of all components, of factors of cones the same in each component.
    """

    lb: Vector
    ub: Vector
    cones: Sequence[ConeFactors] = ()

    @classmethod
    def of(cls, *runs: tuple[int, Any, Any], cones: Sequence[ConeFactors] = ()) -> Sets:
        """Make them of runs (count, lb, ub), one after the other; sides from `INFINITE` on are taken for infinite."""
        lb, ub = (np.concatenate([np.broadcast_to(run[i], run[0]) for run in runs]).astype(float) for i in (1, 2))
        return cls(np.where(lb <= -INFINITE, -np.inf, lb), np.where(ub >= INFINITE, np.inf, ub), cones)

    @cached_property
    def bounded(self) -> tuple[Flags, Flags]:
        """Where the lower and the upper sides are finite."""
        return np.isfinite(self.lb), np.isfinite(self.ub)

    @cached_property
    def off_0(self) -> list[tuple[Vector, Flags, float]]:
        """The sides of which some are not 0, which ones, and 1 for the lower, −1 for the upper."""
        sides = zip((self.lb, self.ub), self.bounded, (1.0, -1.0), strict=True)
        return [(side, some, sign) for side, finite, sign in sides if (some := finite & (side != 0)).any()]

    @cached_property
    def moored(self) -> bool:
        """Return whether a part of the boundary is not 0."""
        return bool(self.off_0) or any(cone.moored for cone in self.cones)

    @cached_property
    def has_0(self) -> bool:
        """Return whether 0 is in the set, so that the nearest point of it is never larger."""
        return bool((self.lb <= 0).all() and (self.ub >= 0).all())

    @cached_property
    def sides(self) -> Vector:
        """Size of the largest finite side of every component."""
        lower, upper = self.bounded
        return np.maximum(np.where(lower, np.abs(self.lb), 0.0), np.where(upper, np.abs(self.ub), 0.0))

    def nearest(self, x: Vector) -> Vector:
        """Return P(x)."""
        return self._with_cones(np.minimum(np.maximum(x, self.lb), self.ub), lambda cone: cone.nearest(x))

    def missed(self, x: Vector) -> Vector:
        """Return the size of the side that a component is beyond, 0 of those within."""
        return np.where(x < self.lb, np.abs(self.lb), np.where(x > self.ub, np.abs(self.ub), 0.0))

    def anchored(self, x: Vector) -> Flags:
        """Return whether a component is at, or beyond, a part of the boundary that is not 0."""
        result = np.zeros(x.size, dtype=bool)
        for side, some, sign in self.off_0:
            result |= some & ((sign * (x - side) <= 0) | (np.abs(x - side) <= NEAR * np.abs(side)))
        return self._with_cones(result, lambda cone: cone.anchored(x))

    def idle(self, x: Vector, f: Vector) -> Flags:
        """Return whether f holds a component on the boundary that it is at: only its sign matters."""
        lower, upper = self.bounded
        below, above = np.abs(x - self.lb), np.abs(x - self.ub)
        result = (lower & (below <= above) & (f > 0)) | (upper & (above <= below) & (f < 0))
        return self._with_cones(result, lambda cone: cone.idle(f))

    def conditions(self, x: Vector, f: Vector, x_unit: Vector, f_unit: Vector) -> Vector:
        """Return the larger of the distances of x̂ from the set and of f̂ from the dual set."""
        f_hat, (lower, upper) = f * f_unit, self.bounded
        below = np.where(lower, (self.lb - x) * x_unit, f_hat)  # without a bound nothing may push towards it
        above = np.where(upper, (x - self.ub) * x_unit, -f_hat)
        result = np.maximum(np.maximum(below, above), 0.0)
        return self._with_cones(result, lambda cone: cone.conditions(x, f, x_unit, f_unit))

    def products(self, x: Vector, f: Vector, reach: Vector) -> Vector:
        """Return x f, of boxes with x counted from the bound to which f pushes, at most `reach`."""
        bound = np.where(f > 0, self.lb, self.ub)
        room = np.where(np.isfinite(bound), x - bound, x)
        inside = np.copysign(np.minimum(np.abs(room), reach), room)
        return self._with_cones(f * inside, lambda cone: cone.products(x, f))

    def defect(self, x: Vector, f: Vector, x_unit: Vector, f_unit: Vector) -> Vector:
        """Return x̂ − P(x̂ − f̂); the set is measured in the units of its part."""
        sides = zip((self.lb, self.ub), self.bounded, strict=True)
        low, high = (np.where(some, x_unit * side, side) for side, some in sides)  # 0·∞ would be NaN
        # no difference of x̂ and x̂ − f̂: a small f is lost beside a large x
        result = np.maximum(np.minimum(f * f_unit, x * x_unit - low), x * x_unit - high)
        return self._with_cones(result, lambda cone: cone.defect(x, f, x_unit, f_unit))

    def _with_cones(self, values: Any, of: Callable[[ConeFactors], Any]) -> Any:
        """Return the values with those of cones in their places."""
        for cone in self.cones:
            values[cone.at] = of(cone)
        return values


@dataclass(frozen=True, eq=False)
class ConeFactors:
    """Factors of one kind and size, each a block, with the methods of `Sets`; `rows` says that their rows f are in
    them, and −x in the normal cone.

    Answers have the shape (count, size), or (count, 1) where all components of a factor have the same.

    Attributes
    ----------
    kind : kind of the factors. at : (count, size) components. mu, mu_r : (count,) coefficients.
    """

    kind: Cone
    at: Components
    mu: Vector
    mu_r: Vector
    rows: bool = False

    @property
    def round(self) -> bool:
        """Whether μ is a radius."""
        return self.kind in (Cone.CYLINDER, Cone.BALL)

    @property
    def moored(self) -> bool:
        return self.round and not self.rows

    def nearest(self, x: Vector) -> Dense:
        return x[self.at] if self.rows else project(self.kind, x[self.at], self.mu, self.mu_r)

    def anchored(self, x: Vector) -> Flags:
        if not self.moored:
            return np.zeros((len(self.at), 1), dtype=bool)
        return ((self.mu > 0) & (row_norms(self._round_part(x[self.at])) >= NEAR * self.mu))[:, None]

    def idle(self, f: Vector) -> Flags:
        # on the boundaries of both cones xᵀf is rounding, and its sign says nothing; a cone that decides nothing would
        # hide a gap beside its constant
        return (f[self.at] != 0).any(axis=1)[:, None]

    def conditions(self, x: Vector, f: Vector, x_unit: Vector, f_unit: Vector) -> Vector:
        if self.round:
            return row_norms(self.defect(x, f, x_unit, f_unit))[:, None]
        inner, other, _ = self._in_units(x, f, x_unit, f_unit)
        outside = row_norms(inner - project(self.kind, inner, self.mu, self.mu_r))
        # Moreau: the part of −y in K is what y lacks of being in the dual cone
        negative = row_norms(project(self.kind, -other, self.mu, self.mu_r))
        return np.maximum(outside, negative)[:, None]

    def products(self, x: Vector, f: Vector) -> Vector:
        inner, other = (f[self.at], x[self.at]) if self.rows else (x[self.at], f[self.at])
        result = np.zeros(self.at.shape)
        result[:, 0] = np.einsum("ij,ij->i", inner, other)
        if self.round:  # the least of ⟨y, f⟩ over the set is below 0
            result[:, 0] += self.mu * row_norms(self._round_part(other))
        return result

    def defect(self, x: Vector, f: Vector, x_unit: Vector, f_unit: Vector) -> Vector:
        inner, other, unit = self._in_units(x, f, x_unit, f_unit)
        return inner - project(self.kind, inner - other, self.mu * unit if self.round else self.mu, self.mu_r)

    def _round_part(self, y: Dense) -> Dense:
        return y[:, 1:] if self.kind is Cone.CYLINDER else y

    def _in_units(self, x: Vector, f: Vector, x_unit: Vector, f_unit: Vector) -> tuple[Dense, Dense, Vector]:
        """Return what is in the factors and what is in their duals, in units, and the units of the former."""
        both = (x[self.at] * x_unit[self.at], x_unit), (f[self.at] * f_unit[self.at], f_unit)
        (inner, unit), (other, _) = reversed(both) if self.rows else both
        return inner, other, unit[self.at[:, 0]]


def of_product(K: ProductCone, *, rows: bool = False, first: int = 0) -> tuple[Vector, Vector, list[ConeFactors]]:
    """Return the sides of the components of a product, and its factors that are no boxes, whose components begin at
    `first`; with `rows`, the rows and not the unknowns are in K.

    Components of {0}, ℝ and ℝ₊ are boxes of unknowns in both cases: the dual of each is one of them.
    """
    kind = np.repeat(K.kind, K.size.astype(np.int64))
    fixed, free = (Cone.FREE, Cone.ZERO) if rows else (Cone.ZERO, Cone.FREE)
    lb = np.where((kind == fixed) | (kind == Cone.NONNEGATIVE), 0.0, -np.inf)
    ub = np.where(kind == fixed, 0.0, np.inf)
    cones: list[ConeFactors] = []
    start = (np.cumsum(K.size) - K.size).astype(np.int64) + first
    curved = (K.size > 0) & ~np.isin(K.kind, (fixed, free, Cone.NONNEGATIVE))
    for of, size in np.unique(np.column_stack([K.kind, K.size])[curved].astype(int), axis=0).tolist():
        some = (K.kind == of) & (K.size == size)
        cones.append(ConeFactors(Cone(of), start[some][:, None] + np.arange(size), K.mu[some], K.mu_r[some], rows))
    return lb, ub, cones


def inverse(x: Vector) -> Vector:
    """Return 1/x, 0 where x is 0 or infinite."""
    return np.divide(1.0, x, out=np.zeros(x.shape), where=x > 0)
