"""Variational inequalities (22), quasi-variational ones and generalized equations (27) to (30): a set with a simple
part, which is projected on, and rows with multipliers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from cpbench.errors import ProblemError
from cpbench.formulations.base import Point, Residuals, formulations, map_field, matrix_field, point_field, vector_field
from cpbench.formulations.conic import ConicProblem, cone_defect
from cpbench.formulations.expressions import Map
from cpbench.formulations.nonlinear import NonlinearProblem
from cpbench.formulations.sizes import check_bounds
from cpbench.foundation.cones import Cone, ProductCone, box_defect, project_box
from cpbench.foundation.matrices import Matrix, Sparse, Vector, norm


@dataclass(frozen=True, eq=False)
class VIPoint(Point):
    """z (n,), λ ≥ 0 of Az ≥ b (m,), μ of Cz = d (k,), ν ≥ 0 of g(z) ≥ 0 (p,)."""

    z: Vector = point_field("n")
    lam: Vector = point_field("m", optional=True)
    mu: Vector = point_field("k", optional=True)
    nu: Vector = point_field("p", optional=True)


class _HasBounds:
    lb: Vector
    ub: Vector


@dataclass(frozen=True, eq=False, kw_only=True)
class SimpleSetProblem(_HasBounds, NonlinearProblem, ConicProblem):
    """A problem over S = {z ∈ K : lb ≤ z ≤ ub}, K a product of factors, all of ℝⁿ where none is given; only components
    of free factors have bounds, so that S is projected on in closed form."""

    cone_rows: ClassVar[str] = "start"
    cone_kinds: ClassVar[tuple[Cone, ...]] = tuple(Cone)

    def check(self) -> None:
        if self.cone_kind.size:
            super().check()
        check_bounds(self.node, self.lb, self.ub)
        bounded = (np.isfinite(self.lb) | np.isfinite(self.ub)) & ~self.in_free_factor
        if bounded.any():
            at = int(np.flatnonzero(bounded)[0])
            raise ProblemError(f"{self.node}.lb", f"or ub bounds component {at}, which is in a factor of K")

    @cached_property
    def K(self) -> ProductCone:
        if not self.cone_kind.size:
            return ProductCone.of((Cone.FREE, 1, self.start.size))
        return ProductCone(self.cone_kind, self.cone_size, self.cone_mu, self.cone_mu_r)

    @cached_property
    def in_free_factor(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """Whether a component is in a factor ℝ, shape (n,)."""
        return np.repeat(self.K.kind == Cone.FREE, self.K.size.astype(np.int64))

    @property
    def only_box(self) -> bool:
        """Whether S is a box: every factor is {0}, ℝ or ℝ₊."""
        return bool(np.isin(self.K.kind, (Cone.ZERO, Cone.FREE, Cone.NONNEGATIVE)).all())

    @property
    def box(self) -> tuple[Vector, Vector]:
        """Bounds that say all of S where `only_box`: those of {0} and ℝ₊ among them."""
        kind = np.repeat(self.K.kind, self.K.size.astype(np.int64))
        lb = np.where(kind == Cone.FREE, self.lb, 0.0)
        return lb, np.where(kind == Cone.ZERO, 0.0, self.ub)

    def project(self, z: Vector) -> Vector:
        return project_box(self.K.project(z), self.lb, self.ub)

    def defect(self, z: Vector, w: Vector) -> Vector:
        """Return z − P_S(z − w), shape (n,), without forming z − w: nothing is lost beside a large z or w."""
        return self._defect(z, w, self.K, self.lb, self.ub)

    def _defect(self, z: Vector, w: Vector, K: ProductCone, lb: Vector, ub: Vector) -> Vector:
        return np.where(self.in_free_factor, box_defect(z, w, lb, ub), cone_defect(K, z, w))


@dataclass(frozen=True, eq=False)
class GEPoint(Point):
    """z, shape (n,)."""

    z: Vector = point_field("n")


@formulations.register("ge")
@dataclass(frozen=True, eq=False, kw_only=True)
class GE(SimpleSetProblem):
    """0 ∈ F(z) + T(z), T the normal cone of S = {z ∈ K : lb ≤ z ≤ ub}, a maximal monotone operator.

    For (30), the conditions of a nonlinear program, z = (x, λ, μ) and S = ℝⁿ × ℝ₊ × ℝ. Measured: `natural` =
    ‖z − P_S(z − F(z))‖₂ over `scale`.
    """

    node: ClassVar[str] = "ge"
    title: ClassVar[str] = "generalized equation"
    equation: ClassVar[str] = "(27)"
    relations: ClassVar[tuple[str, ...]] = ("0 ∈ F(z) + N_S(z)", "S = {z ∈ K : lb ≤ z ≤ ub}")
    point_type: ClassVar[type[Point]] = GEPoint

    F: Map = map_field("n", "n")
    lb: Vector = vector_field("n", finite=False, fill=-np.inf)
    ub: Vector = vector_field("n", finite=False, fill=np.inf)
    cone_kind: Vector = vector_field("c", fill=0.0)
    cone_size: Vector = vector_field("c", fill=0.0)
    cone_mu: Vector = vector_field("c", finite=False, fill=0.0)
    cone_mu_r: Vector = vector_field("c", fill=0.0)
    start: Vector = vector_field("n", fill=0.0)

    def slacks(self, point: GEPoint) -> dict[str, Vector]:
        return {"w": self.F(point.z)}

    def measure(self, point: GEPoint, tolerance: float) -> Residuals:
        z = point.z
        return self.natural(self.defect(z, self.F(z)), point.finite, infeasibility=norm(z - self.project(z)))


@formulations.register("vi")
@dataclass(frozen=True, eq=False, kw_only=True)
class VI(SimpleSetProblem):
    """−F(z) ∈ N_X(z), X = {z ∈ K : lb ≤ z ≤ ub, Az ≥ b, Cz = d, g(z) ≥ 0}, each part of which may be left out.

    K is a product of {0}, ℝ, ℝ₊, second-order and rolling cones with their duals, ℝ₊ × disk, and balls. g is concave,
    or X would not be convex; this is not checked. With G = F − Aᵀλ − Cᵀμ − ∇g ν: z = P_S(z − G), S the part of X
    without rows, 0 ≤ λ ⟂ Az − b ≥ 0, Cz = d, 0 ≤ ν ⟂ g(z) ≥ 0. Measured: `natural`, the norm of all that over `scale`.
    """

    node: ClassVar[str] = "vi"
    core: ClassVar[bool] = True
    title: ClassVar[str] = "variational inequality"
    equation: ClassVar[str] = "(22)"
    relations: ClassVar[tuple[str, ...]] = (
        "F(z)ᵀ(y − z) ≥ 0 for all y ∈ X",
        "z ∈ X = {z ∈ K : lb ≤ z ≤ ub, Az ≥ b, Cz = d, g(z) ≥ 0}",
    )
    point_type: ClassVar[type[Point]] = VIPoint
    primal: ClassVar[str] = "z"

    F: Map = map_field("n", "n")
    g: Map = map_field("p", "n", optional=True)
    A: Matrix = matrix_field("m", "n", optional=True)
    b: Vector = vector_field("m", fill=0.0)
    C: Matrix = matrix_field("k", "n", optional=True)
    d: Vector = vector_field("k", fill=0.0)
    lb: Vector = vector_field("n", finite=False, fill=-np.inf)
    ub: Vector = vector_field("n", finite=False, fill=np.inf)
    cone_kind: Vector = vector_field("c", fill=0.0)
    cone_size: Vector = vector_field("c", fill=0.0)
    cone_mu: Vector = vector_field("c", finite=False, fill=0.0)
    cone_mu_r: Vector = vector_field("c", fill=0.0)
    start: Vector = vector_field("n", fill=0.0)

    def force(self, point: VIPoint) -> Vector:
        """Return G, F less the forces of the rows, at a point; shape (n,)."""
        G = self.F(point.z) - self.A.T @ point.lam - self.C.T @ point.mu
        return G - self.g.jacobian(point.z).T @ point.nu if self.g.rows else G

    def row_defects(self, point: VIPoint) -> list[Vector]:
        """Return min(λ, Az − b), Cz − d and min(ν, g): 0 where the rows hold and complement their forces."""
        rows = [np.minimum(point.lam, self.A @ point.z - self.b), self.C @ point.z - self.d]
        return [*rows, np.minimum(point.nu, self.g(point.z))] if self.g.rows else rows

    def measure(self, point: VIPoint, tolerance: float) -> Residuals:
        z = point.z
        defect = np.concatenate([self.defect(z, self.force(point)), *self.row_defects(point)])
        return self.natural(defect, point.finite, infeasibility=norm(z - self.project(z)))


@dataclass(frozen=True, eq=False)
class QVIPoint(Point):
    """z (n,), ν ≥ 0 of g(y, z) ≥ 0 (p,)."""

    z: Vector = point_field("n")
    nu: Vector = point_field("p", optional=True)


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

    def measure(self, point: QVIPoint, tolerance: float) -> Residuals:
        z, G = point.z, self.F(point.z)
        if self.g.rows:
            G = G - self.row_slopes(z).T @ point.nu
        defect = [self.defect(z, G), np.minimum(point.nu, self.row_values(z))]
        outside = norm(z - self.project_at(z, z))
        return self.natural(np.concatenate(defect), point.finite, infeasibility=outside)
