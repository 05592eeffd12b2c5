"""Quasi-variational inequality: find z ∈ X(z) with F(z)ᵀ(y − z) ≥ 0 for all y ∈ X(z), a set that moves with z."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from cpbench.errors import ProblemError
from cpbench.formulations.base import Point, Residuals, formulations, map_field, vector_field
from cpbench.formulations.expressions import Map
from cpbench.formulations.variational import SimpleSetProblem
from cpbench.foundation.cones import project_box
from cpbench.foundation.matrices import Sparse, Vector, norm
from cpbench.foundation.product_cones import Cone, ProductCone


@dataclass(frozen=True, eq=False)
class QVIPoint(Point):
    """z (n,), ν ≥ 0 of g(y, z) ≥ 0 (p,)."""

    z: Vector
    nu: Vector = field(default_factory=lambda: np.zeros(0))


@formulations.register("qvi")
@dataclass(frozen=True, eq=False, kw_only=True)
class QVI(SimpleSetProblem):
    """−F(z) ∈ N_X(z)(z), X(z) = {y ∈ K(z) : max(lb, lower(z)) ≤ y ≤ min(ub, upper(z)), g(y, z) ≥ 0}.

    K(z) is a product as of `vi`, save that a factor ℝ₊ × disk has the radius μ max(z_N, 0) with z_N its own first
    component: Coulomb's law. `lower` and `upper` are maps to ℝⁿ, or left out; they bound free components. g takes
    (y, z), 2n numbers, and is concave in y. With G = F(z) − ∇_y g(z, z) ν: z = P_S(z)(z − G), S(z) the part of X(z)
    without g, and 0 ≤ ν ⟂ g(z, z) ≥ 0. Measured: `natural`, the norm of both over `scale`.
    """

    node: ClassVar[str] = "qvi"
    title: ClassVar[str] = "quasi-variational inequality"
    equation: ClassVar[str] = "(22) with X(z)"
    relations: ClassVar[tuple[str, ...]] = (
        "F(z)ᵀ(y − z) ≥ 0 for all y ∈ X(z)",
        "z ∈ X(z) = {y ∈ K(z) : lower(z) ≤ y ≤ upper(z), g(y, z) ≥ 0}",
    )
    point_type: ClassVar[type[Point]] = QVIPoint

    F: Map = map_field("n", "n")
    g: Map = map_field("p", "2n", optional=True)
    lower: Map = map_field("nl", "n", optional=True)
    upper: Map = map_field("nu", "n", optional=True)
    lb: Vector = vector_field("n", finite=False, fill=-np.inf)
    ub: Vector = vector_field("n", finite=False, fill=np.inf)
    cone_kind: Vector = vector_field("c", fill=0.0)
    cone_size: Vector = vector_field("c", fill=0.0)
    cone_mu: Vector = vector_field("c", finite=False, fill=0.0)
    cone_mu_r: Vector = vector_field("c", fill=0.0)
    start: Vector = vector_field("n", fill=0.0)

    def check(self) -> None:
        super().check()
        n = self.start.size
        for name, bound in (("lower", self.lower), ("upper", self.upper)):
            if bound.rows not in (0, n):
                raise ProblemError(f"qvi.{name}", f"has {bound.rows} rows, expected {n} or none")
            if bound.rows and not self.in_free_factor.all():
                raise ProblemError(f"qvi.{name}", "moves bounds beside factors of K; only free components may have any")

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"z": self.start.size, "nu": self.g.rows}

    def set_at(self, z: Vector) -> tuple[ProductCone, Vector, Vector]:
        """Return S(z): the product, and the bounds of its free components (lb ≤ ub unless X(z) is empty)."""
        K, lb, ub = self.K, self.lb, self.ub
        if self._normals.size:
            mu = K.mu.copy()
            moving = K.kind == Cone.CYLINDER
            mu[moving] *= np.maximum(z[self._normals], 0.0)
            K = ProductCone(K.kind, K.size, mu, K.mu_r)
        if self.lower.rows:
            lb = np.maximum(lb, self.lower(z))
        if self.upper.rows:
            ub = np.minimum(ub, self.upper(z))
        return K, lb, ub

    @cached_property
    def _normals(self) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        """First components of the factors that move."""
        sizes = self.K.size.astype(np.int64)
        return (np.cumsum(sizes) - sizes)[self.K.kind == Cone.CYLINDER]

    def project_at(self, z: Vector, x: Vector) -> Vector:
        """Return P_S(z)(x), shape (n,)."""
        K, lb, ub = self.set_at(z)
        return project_box(K.project(x), lb, ub)

    def defect(self, z: Vector, w: Vector) -> Vector:
        """Return z − P_S(z)(z − w), shape (n,)."""
        return self._defect(z, w, *self.set_at(z))

    def row_values(self, z: Vector) -> Vector:
        """Return g(z, z), shape (p,)."""
        return self.g(np.concatenate([z, z])) if self.g.rows else np.zeros(0)

    def row_slopes(self, z: Vector) -> Sparse:
        """Return ∂g/∂y at (z, z), shape (p, n)."""
        return self.g.jacobian(np.concatenate([z, z]))[:, : z.size]

    def residuals(self, point: QVIPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            z, G = point.z, self.F(point.z)
            if self.g.rows:
                G = G - self.row_slopes(z).T @ point.nu
            defect = [self.defect(z, G), np.minimum(point.nu, self.row_values(z))]
            outside = norm(z - self.project_at(z, z))
            return self.natural(np.concatenate(defect), point.finite, infeasibility=outside)
