"""Base of the variational nodes: a set with a simple part, which is projected on, and rows with multipliers."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from cpbench.errors import ProblemError
from cpbench.formulations.base import Point, Residuals
from cpbench.formulations.box import check_bounds
from cpbench.formulations.conic import ConicProblem
from cpbench.formulations.defects import cone_defect
from cpbench.formulations.nonlinear import NonlinearProblem
from cpbench.foundation.cones import box_defect, project_box
from cpbench.foundation.matrices import Matrix, Vector, norm
from cpbench.foundation.product_cones import Cone, ProductCone


@dataclass(frozen=True, eq=False)
class VIPoint(Point):
    """z (n,), λ ≥ 0 of Az ≥ b (m,), μ of Cz = d (k,), ν ≥ 0 of g(z) ≥ 0 (p,)."""

    z: Vector
    lam: Vector = field(default_factory=lambda: np.zeros(0))
    mu: Vector = field(default_factory=lambda: np.zeros(0))
    nu: Vector = field(default_factory=lambda: np.zeros(0))


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


class _HasRows:
    A: Matrix
    b: Vector
    C: Matrix
    d: Vector


@dataclass(frozen=True, eq=False, kw_only=True)
class RowsProblem(_HasRows, SimpleSetProblem):
    """A problem over X = {z ∈ S : Az ≥ b, Cz = d} and whatever the node adds.

    Rows of A and C have multipliers, which are part of an answer (as in `avi`): with G = F(z) − Aᵀλ − Cᵀμ the
    conditions are z = P_S(z − G), 0 ≤ λ ⟂ Az − b ≥ 0, Cz = d.
    """

    def force(self, point: VIPoint) -> Vector:
        """Return G of the class, F less the forces of the rows, at a point; shape (n,)."""
        return self.F(point.z) - self.A.T @ point.lam - self.C.T @ point.mu

    def row_defects(self, point: VIPoint) -> list[Vector]:
        """Return min(λ, Az − b), shape (m,), and Cz − d, shape (p,): 0 where the rows hold and complement their
        forces."""
        return [np.minimum(point.lam, self.A @ point.z - self.b), self.C @ point.z - self.d]

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"z": self.start.size, "lam": self.b.size, "mu": self.d.size, "nu": 0}

    def residuals(self, point: VIPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            z = point.z
            rows = self.row_defects(point)
            defect = np.concatenate([self.defect(z, self.force(point)), *rows])
            outside = norm(z - self.project(z))
            return self.natural(defect, point.finite, infeasibility=outside)
