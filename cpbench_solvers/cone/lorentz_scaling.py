"""Nesterov and Todd's scaling of {0}, ℝ₊ and Lorentz cones, vectorised over the cones of one size.

For s and y inside the cone W is the symmetric matrix with Wy = W⁻¹s = λ: of a Lorentz cone

    W = η [ w₀  w₁ᵀ; w₁  I + w₁w₁ᵀ/(1 + w₀) ],  η⁴ = det s/det y,  W² = η²(2wwᵀ − J),  J = diag(1, −I),

with det s = s₀² − ‖s₁‖² and w the scaling point of unit determinant. ℝ₊ is a Lorentz cone of one component, and rows in
{0} have W = 0. The product of the algebra is u ∘ v = (uᵀv, u₀v₁ + v₀u₁). Arrays have one row a cone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.foundation.matrices import Dense, Sparse, Vector

TINY = 1e-300
TOUCHING = 1e-12
"""A way that misses the boundary by less, relative to its size, ends there."""


@dataclass(frozen=True)
class LorentzCones:
    """{0}, ℝ₊ and Lorentz cones of `rows` components. groups : (count, size) the components of the cones of one size.

    `degree` is the number of cones but {0}, the size of a barrier."""

    rows: int
    groups: tuple[NDArray[np.int64], ...]

    @classmethod
    def of(cls, cones: list[tuple[str, int]]) -> LorentzCones:
        """Build from what `lorentz_rows` names: {0} and ℝ₊ of several components, and Lorentz cones, in this order."""
        starts: dict[int, list[int]] = {}
        at = 0
        for kind, size in cones:
            if kind == "nonnegative":
                starts.setdefault(1, []).extend(range(at, at + size))
            elif kind == "lorentz":
                starts.setdefault(size, []).append(at)
            at += size
        groups = tuple(np.array(first)[:, None] + np.arange(size) for size, first in sorted(starts.items()))
        return cls(at, groups)

    @property
    def degree(self) -> int:
        return sum(rows.shape[0] for rows in self.groups)

    def identity(self) -> Vector:
        """Return e: 1 in the first component of every cone."""
        e = np.zeros(self.rows)
        for rows in self.groups:
            e[rows[:, 0]] = 1.0
        return e

    def margin(self, s: Vector) -> float:
        """Return the least s₀ − ‖s₁‖, ∞ without a cone."""
        return min((float((s[r][:, 0] - _length(s[r])).min()) for r in self.groups if r.size), default=np.inf)

    def product(self, u: Vector, v: Vector) -> Vector:
        """Return u ∘ v; 0 in rows of {0}."""
        result = np.zeros(self.rows)
        for rows in self.groups:
            a, b = u[rows], v[rows]
            result[rows] = a[:, :1] * b + b[:, :1] * a
            result[rows[:, 0]] = np.einsum("ij,ij->i", a, b)
        return result

    def divided(self, u: Vector, r: Vector) -> Vector:
        """Return the v with u ∘ v = r, u inside; 0 in rows of {0}."""
        result = np.zeros(self.rows)
        for rows in self.groups:
            a, b = u[rows], r[rows]
            first = (a[:, 0] * b[:, 0] - np.einsum("ij,ij->i", a[:, 1:], b[:, 1:])) / _determinant(a)
            result[rows] = (b - first[:, None] * a) / a[:, :1]
            result[rows[:, 0]] = first
        return result

    def longest(self, s: Vector, d: Vector) -> float:
        """Return the largest t with s + td in every cone, s inside; ∞ where there is none."""
        longest = np.inf
        for rows in self.groups:
            x, v = s[rows], d[rows]
            if rows.shape[1] == 1:  # of which the formula below would lose half of the digits
                falls = v < 0.0
                longest = min(longest, float((x[falls] / -v[falls]).min(initial=np.inf)))
                continue
            a, c = _determinant(v, signed=True), _determinant(x)
            b = x[:, 0] * v[:, 0] - np.einsum("ij,ij->i", x[:, 1:], v[:, 1:])
            # the first positive root of a t² + 2 b t + c, c > 0, in the form that does not cancel
            disc = b * b - a * c
            slope = np.sqrt(np.maximum(disc, 0.0)) - b
            leaves = (disc >= -TOUCHING * b * b) & (slope > 0.0)
            t = np.where(leaves, c / np.where(leaves, slope, 1.0), np.inf)
            longest = min(longest, float(t.min(initial=np.inf)))
        return longest


@dataclass(frozen=True)
class GroupScaling:
    """W of one pair (s, y): the w and η of every group, and λ."""

    cones: LorentzCones
    w: tuple[Dense, ...]
    eta: tuple[Vector, ...]
    lam: Vector

    @classmethod
    def of(cls, cones: LorentzCones, s: Vector, y: Vector) -> GroupScaling:
        """Return the scaling of s and y, inside their cones."""
        points: list[Dense] = []
        etas: list[Vector] = []
        lam = np.zeros(cones.rows)
        for rows in cones.groups:
            det_s, det_y = (np.sqrt(_determinant(v[rows])) for v in (s, y))
            a, b = s[rows] / det_s[:, None], y[rows] / det_y[:, None]
            gamma = np.sqrt(0.5 * (1.0 + np.einsum("ij,ij->i", a, b)))
            w = a - b
            w[:, 0] = a[:, 0] + b[:, 0]
            points.append(w / (2.0 * gamma)[:, None])
            etas.append(np.sqrt(det_s / det_y))
        scaling = cls(cones, tuple(points), tuple(etas), lam)
        lam[:] = scaling.times(y)
        return scaling

    def times(self, v: Vector) -> Vector:
        """Return Wv; 0 in rows of {0}."""
        result = np.zeros(self.cones.rows)
        for rows, w, eta in zip(self.cones.groups, self.w, self.eta, strict=True):
            x = v[rows]
            along = np.einsum("ij,ij->i", w[:, 1:], x[:, 1:])
            moved = x + (x[:, 0] + along / (1.0 + w[:, 0]))[:, None] * w
            moved[:, 0] = w[:, 0] * x[:, 0] + along
            result[rows] = eta[:, None] * moved
        return result

    def squared(self) -> Sparse:
        """Return W², block diagonal."""
        row, column, value = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)], [np.zeros(0)]
        for rows, w, eta in zip(self.cones.groups, self.w, self.eta, strict=True):
            size = rows.shape[1]
            J = np.diag(np.concatenate([[1.0], -np.ones(size - 1)]))
            blocks = (eta**2)[:, None, None] * (2.0 * w[:, :, None] * w[:, None, :] - J)
            row.append(np.repeat(rows, size, axis=1).ravel())
            column.append(np.tile(rows, (1, size)).ravel())
            value.append(blocks.ravel())
        entries = (np.concatenate(row), np.concatenate(column))
        return sp.csr_array((np.concatenate(value), entries), shape=(self.cones.rows, self.cones.rows))


def _length(x: Dense) -> Vector:
    return np.sqrt(np.einsum("ij,ij->i", x[:, 1:], x[:, 1:]))


def _determinant(x: Dense, *, signed: bool = False) -> Vector:
    """Return x₀² − ‖x₁‖², as a product; of points inside, not less than a tiny number."""
    length = _length(x)
    value = (x[:, 0] - length) * (x[:, 0] + length)
    return value if signed else np.maximum(value, TINY)
