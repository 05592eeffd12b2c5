"""Projections and distances, vectorised over contacts, and products of cones, the sets of the conic nodes.

The friction cone of a contact is K_μ = {r : ‖r_T‖ ≤ μ r_N}, normal first; its dual is K*_μ = {û : û_N ≥ μ‖û_T‖}
(the cone K_{1/μ} for μ > 0, a half space for μ = 0). Arrays of contacts have shape (nc, d), d = 2 or 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # guests in another interpreter project by this module, and have NumPy alone
    from cpbench.foundation.matrices import Dense, Vector


def tangential_norm(x: Dense) -> Vector:
    """Return ‖x_T‖ of every row (normal component first)."""
    return np.abs(x[:, 1]) if x.shape[1] == 2 else np.sqrt(np.einsum("ij,ij->i", x[:, 1:], x[:, 1:]))


def project_friction_cone(x: Dense, mu: Vector) -> Dense:
    """Project every row on K_μ (Euclidean); shape (nc, d)."""
    t = tangential_norm(x)
    xn = x[:, 0]
    outside = t > mu * xn
    polar = mu * t <= -xn
    with np.errstate(divide="ignore", invalid="ignore"):
        normal = (mu * t + xn) / (1.0 + mu * mu)
        factor = np.where(t > 0, mu * normal / t, 0.0)
    result = x * np.where(outside, factor, 1.0)[:, None]
    result[:, 0] = np.where(outside, normal, xn)
    result[polar] = 0.0
    return result


def de_saxce(u: Dense, mu: Vector) -> Dense:
    """Return û = u + μ‖u_T‖ e_N, De Saxcé's change of variable (De Saxcé and Feng 1998)."""
    shifted = u.copy()
    shifted[:, 0] += mu * tangential_norm(u)
    return shifted


def project_box(x: Vector, lower: Vector, upper: Vector) -> Vector:
    """Project on lower ≤ x ≤ upper (infinite bounds allowed)."""
    return np.minimum(np.maximum(x, lower), upper)


def box_defect(z: Vector, w: Vector, lower: Vector, upper: Vector) -> Vector:
    """Return z − P(z − w), P the projection on the box, without forming z − w: no w is lost below the last digit of
    z."""
    return np.maximum(np.minimum(w, z - lower), z - upper)


def rolling_norms(x: Dense) -> tuple[Vector, Vector]:
    """Return ‖x_T‖ and ‖x_M‖ of rows (N, T, M) or (N, T1, T2, M1, M2)."""
    k = (x.shape[1] - 1) // 2
    return np.linalg.norm(x[:, 1 : 1 + k], axis=1), np.linalg.norm(x[:, 1 + k :], axis=1)


def project_rolling_cone(x: Dense, mu: Vector, mu_r: Vector) -> Dense:
    """Project every row on {r : ‖r_T‖ ≤ μ r_N, ‖m‖ ≤ μ_r r_N} (Euclidean); shape (nc, 3) or (nc, 5).

    For a given r_N the nearest r_T and m are x_T and x_M clipped, so r_N is the root of an increasing piecewise linear
    g(r) = r − x_N − μ(‖x_T‖ − μr)₊ − μ_r(‖x_M‖ − μ_r r)₊, and its signs at the two kinks tell which clips are active.
    Comparing distances instead would lose half of the digits.
    """
    k = (x.shape[1] - 1) // 2
    xn = x[:, 0]
    t, m = rolling_norms(x)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        kink_t, kink_m = np.where(mu > 0, t / mu, np.inf), np.where(mu_r > 0, m / mu_r, np.inf)
        swap = kink_m < kink_t
        first, second = np.minimum(kink_t, kink_m), np.maximum(kink_t, kink_m)
        c, size = np.where(swap, mu, mu_r), np.where(swap, t, m)  # of the clip that ends at the second kink
        both = (xn + mu * t + mu_r * m) / (1.0 + mu**2 + mu_r**2)
        one = (xn + c * size) / (1.0 + c**2)
        before_first = first - xn - np.where(c > 0, c * (size - c * first), 0.0) >= 0
    best = np.maximum(np.where(before_first, both, np.where(second >= xn, one, xn)), 0.0)
    result = np.empty_like(x)
    result[:, 0] = best
    for part, size, bound in ((slice(1, 1 + k), t, mu * best), (slice(1 + k, None), m, mu_r * best)):
        result[:, part] = x[:, part] * _shrink(size, bound)[:, None]
    return result


def rolling_de_saxce(u: Dense, mu: Vector, mu_r: Vector) -> Dense:
    """Return û = u + (μ‖u_T‖ + μ_r‖ω‖) e_N, the change of variable for rolling friction (Acary and Bourrier 2021)."""
    t, m = rolling_norms(u)
    shifted = u.copy()
    shifted[:, 0] += mu * t + mu_r * m
    return shifted


def project_cylinder(x: Dense, radius: Vector) -> Dense:
    """Project every row on ℝ₊ × disk of that radius (Tresca's friction with a given threshold)."""
    result = x.copy()
    result[:, 0] = np.maximum(x[:, 0], 0.0)
    result[:, 1:] *= _shrink(np.linalg.norm(x[:, 1:], axis=1), radius)[:, None]
    return result


def _shrink(size: Vector, bound: Vector) -> Vector:
    """Factor that takes a length `size` to at most `bound`."""
    outside = size > bound
    return np.where(outside, bound / np.where(outside, size, 1.0), 1.0)


class Law(Protocol):
    """Friction law of all contacts: De Saxcé's shift, and the cone of the reactions."""

    def shift(self, u: Dense) -> Dense:
        """Return û of velocities u, shape (nc, d)."""
        ...

    def project(self, r: Dense) -> Dense:
        """Project every row on the cone K of its contact."""
        ...

    def in_units(self, lengths: Dense) -> Law:
        """Return the law of r/lengths and u·lengths, shape (nc, d), constant over the moments of a contact, 1
        elsewhere."""
        ...


@dataclass(frozen=True, eq=False)
class Coulomb:
    """‖r_T‖ ≤ μ r_N, û = u + μ‖u_T‖e_N."""

    mu: Vector

    def shift(self, u: Dense) -> Dense:
        return de_saxce(u, self.mu)

    def project(self, r: Dense) -> Dense:
        return project_friction_cone(r, self.mu)

    def in_units(self, lengths: Dense) -> Coulomb:
        return self


@dataclass(frozen=True, eq=False)
class RollingCoulomb:
    """‖r_T‖ ≤ μ r_N and ‖m‖ ≤ μ_r r_N, û = u + (μ‖u_T‖ + μ_r‖ω‖)e_N."""

    mu: Vector
    mu_r: Vector

    def shift(self, u: Dense) -> Dense:
        return rolling_de_saxce(u, self.mu, self.mu_r)

    def project(self, r: Dense) -> Dense:
        return project_rolling_cone(r, self.mu, self.mu_r)

    def in_units(self, lengths: Dense) -> RollingCoulomb:
        return RollingCoulomb(self.mu, self.mu_r / lengths[:, -1])


class Cone(IntEnum):
    """Factors of a product; the numbers are those of the files."""

    ZERO = 0
    """{0}; its dual is FREE."""
    FREE = 1
    """The whole space."""
    NONNEGATIVE = 2
    """The orthant."""
    SECOND_ORDER = 3
    """{x : ‖x_T‖ ≤ μ x_N}, first component normal; μ = ∞ is the half space x_N ≥ 0, dual of μ = 0."""
    ROLLING = 4
    """{x : ‖x_T‖ ≤ μ x_N, ‖x_M‖ ≤ μ_r x_N}, 3 or 5 components."""
    ROLLING_DUAL = 5
    """{x : x_N ≥ μ‖x_T‖ + μ_r‖x_M‖}."""
    CYLINDER = 6
    """ℝ₊ × disk of radius μ: a convex set and no cone, the threshold of Tresca's friction."""
    BALL = 7
    """{x : ‖x‖ ≤ μ}: a convex set and no cone, of variational inequalities only."""


@dataclass(frozen=True, eq=False)
class ProductCone:
    """K = K₁ × … × K_k of closed convex factors over consecutive components.

    Attributes
    ----------
    kind : (k,) numbers of `Cone`. size : (k,) components of each factor.
    mu, mu_r : (k,) coefficients, 0 where a factor has none.
    """

    kind: Vector
    size: Vector
    mu: Vector
    mu_r: Vector

    @classmethod
    def of(cls, *factors: tuple[Any, ...]) -> ProductCone:
        """Build the product of runs (kind, count, size, mu, mu_r): `count` equal factors of `size` components each.

        >>> ProductCone.of((Cone.FREE, 1, 2), (Cone.SECOND_ORDER, 2, 3, np.array([0.5, 0.7]))).rows
        8
        """
        parts: list[list[Vector]] = [[], [], [], []]
        for kind, count, size, *coefficients in factors:
            mu, mu_r = (*coefficients, *(0.0,) * (2 - len(coefficients)))
            for part, value in zip(parts, (kind, size, mu, mu_r), strict=True):
                part.append(np.broadcast_to(np.asarray(value, dtype=float), (count,)))
        return cls(*(np.concatenate(part) if part else np.zeros(0) for part in parts))

    @property
    def rows(self) -> int:
        return int(self.size.sum())

    @property
    def conical(self) -> bool:
        """Return whether every factor is a cone."""
        return not np.isin(self.kind, (Cone.CYLINDER, Cone.BALL)).any()

    @cached_property
    def blocks(self) -> NDArray[np.int64]:
        """The number of the finest factor of each component, shape (rows,): every row of {0}, ℝ, ℝ₊ is one."""
        sizes = self.size.astype(np.int64)
        alone = np.repeat(np.isin(self.kind, (Cone.ZERO, Cone.FREE, Cone.NONNEGATIVE)), sizes)
        first = np.repeat(np.cumsum(sizes) - sizes, sizes) == np.arange(self.rows)
        return np.cumsum(alone | first) - 1

    @cached_property
    def extended(self) -> NDArray[np.bool_]:
        """Return whether K is more than {0} in a component, (rows,); where it is not, the dual part may be anything."""
        result = np.ones(self.rows, dtype=bool)
        for kind, rows, mu, mu_r in self.groups:
            k = (rows.shape[1] - 1) // 2
            match kind:
                case Cone.ZERO:
                    result[rows] = False
                case Cone.SECOND_ORDER | Cone.CYLINDER:
                    result[rows[mu == 0, 1:]] = False
                case Cone.ROLLING:
                    result[rows[mu == 0, 1 : 1 + k]] = False
                    result[rows[mu_r == 0, 1 + k :]] = False
                case _:
                    pass
        return result

    @cached_property
    def groups(self) -> list[tuple[Cone, NDArray[np.int64], Vector, Vector]]:
        """Factors of one kind and size together: their kind, rows (count, size), mu and mu_r."""
        start = np.concatenate([[0], np.cumsum(self.size)])[:-1].astype(np.int64)
        groups: list[tuple[Cone, NDArray[np.int64], Vector, Vector]] = []
        for kind, size in sorted(set(zip(self.kind.tolist(), self.size.tolist(), strict=True))):
            members = np.flatnonzero((self.kind == kind) & (self.size == size))
            rows = start[members][:, None] + np.arange(int(size))
            groups.append((Cone(int(kind)), rows, self.mu[members], self.mu_r[members]))
        return groups

    def project(self, x: Vector) -> Vector:
        """Project x, shape (rows,), on K (Euclidean)."""
        result = np.empty_like(x)
        for kind, rows, mu, mu_r in self.groups:
            result[rows] = _project_factor(kind, x[rows], mu, mu_r)
        return result

    def project_dual(self, y: Vector) -> Vector:
        """Project on K* = {y : yᵀx ≥ 0 for x ∈ K}, by Moreau's decomposition; K must be a cone."""
        return y + self.project(-y)

    def in_units(self, unit: Vector) -> ProductCone:
        """Return K of unit·x, `unit` (rows,) the same in a factor: only the radii of disks and balls are lengths."""
        first = np.cumsum(self.size).astype(int) - self.size.astype(int)  # that of an empty factor may be `rows`
        lengths = np.where(np.isin(self.kind, (Cone.CYLINDER, Cone.BALL)), np.append(unit, 1.0)[first], 1.0)
        return ProductCone(self.kind, self.size, self.mu * lengths, self.mu_r)

    def dual(self) -> ProductCone:
        """Return K*; K must be a cone."""
        swap = {
            Cone.ZERO: Cone.FREE,
            Cone.FREE: Cone.ZERO,
            Cone.ROLLING: Cone.ROLLING_DUAL,
            Cone.ROLLING_DUAL: Cone.ROLLING,
        }
        kind = np.array([float(swap.get(Cone(int(k)), Cone(int(k)))) for k in self.kind])
        with np.errstate(divide="ignore"):
            mu = np.where(self.kind == Cone.SECOND_ORDER, 1.0 / self.mu, self.mu)
        return ProductCone(kind, self.size, mu, self.mu_r)


def _project_factor(kind: Cone, x: Dense, mu: Vector, mu_r: Vector) -> Dense:
    match kind:
        case Cone.ZERO:
            return np.zeros_like(x)
        case Cone.FREE:
            return x
        case Cone.NONNEGATIVE:
            return np.maximum(x, 0.0)
        case Cone.SECOND_ORDER:
            half_space = np.isinf(mu)
            result = project_friction_cone(x, np.where(half_space, 1.0, mu))
            result[half_space, 0] = np.maximum(x[half_space, 0], 0.0)
            result[half_space, 1:] = x[half_space, 1:]
            return result
        case Cone.ROLLING:
            return project_rolling_cone(x, mu, mu_r)
        case Cone.ROLLING_DUAL:
            return x + project_rolling_cone(-x, mu, mu_r)
        case Cone.CYLINDER:
            return project_cylinder(x, mu)
        case Cone.BALL:
            size = np.sqrt(np.einsum("ij,ij->i", x, x))
            return x * np.where(size > mu, mu / np.where(size > mu, size, 1.0), 1.0)[:, None]
