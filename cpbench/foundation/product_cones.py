"""Products of cones, the sets of the conic nodes: projection, dual, vectorised over factors of one kind and size."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cpbench.foundation.cones import project_cylinder, project_friction_cone, project_rolling_cone

if TYPE_CHECKING:
    from cpbench.foundation.matrices import Dense, Vector


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
