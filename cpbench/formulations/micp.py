"""Mixed complementarity problem, Acary's equations (20) and (21), with bounds: the 'MCP' of PATH."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.base import Point, Residuals, formulations, map_field, vector_field
from cpbench.formulations.box import check_bounds
from cpbench.formulations.expressions import Map
from cpbench.formulations.nonlinear import NonlinearProblem
from cpbench.foundation.cones import box_defect, project_box
from cpbench.foundation.matrices import Vector, norm


@dataclass(frozen=True, eq=False)
class MiCPPoint(Point):
    """z, shape (n,)."""

    z: Vector


@formulations.register("micp")
@dataclass(frozen=True, eq=False, kw_only=True)
class MiCP(NonlinearProblem):
    """lb ≤ z ≤ ub, and for every i: zᵢ = lbᵢ < ubᵢ ⇒ Fᵢ ≥ 0, zᵢ = ubᵢ > lbᵢ ⇒ Fᵢ ≤ 0, in between Fᵢ = 0.

    Bounds may be infinite: a free zᵢ has Fᵢ(z) = 0. Where lbᵢ = ubᵢ, Fᵢ is free. Definition (20), G(u, v) = 0 with
    0 ≤ v ⟂ H(u, v) ≥ 0, is z = (u, v) with lb = (−∞, 0); definition (21), with index sets C and F, has lb = 0 on C and
    −∞ on F (`from_index_set`). Measured: `natural` = ‖z − P_[lb,ub](z − F(z))‖₂ over `scale`.
    """

    node: ClassVar[str] = "micp"
    title: ClassVar[str] = "mixed complementarity problem, nonlinear"
    equation: ClassVar[str] = "(20), (21)"
    relations: ClassVar[tuple[str, ...]] = (
        "lb ≤ z ≤ ub",
        "zᵢ = lbᵢ ⇒ Fᵢ(z) ≥ 0",
        "zᵢ = ubᵢ ⇒ Fᵢ(z) ≤ 0",
        "lbᵢ < zᵢ < ubᵢ ⇒ Fᵢ(z) = 0",
    )
    point_type: ClassVar[type[Point]] = MiCPPoint

    F: Map = map_field("n", "n")
    lb: Vector = vector_field("n", finite=False)
    ub: Vector = vector_field("n", finite=False)
    start: Vector = vector_field("n", fill=0.0)

    @classmethod
    def from_index_set(cls, F: Map, complementary: Sequence[int], **others: Any) -> MiCP:
        """Build a problem by definition (21): z_C ≥ 0 beside F_C(z) ≥ 0 for the indices given, F_i(z) = 0 for the
        others."""
        lb = np.full(F.inputs, -np.inf)
        lb[list(complementary)] = 0.0
        return cls(F=F, lb=lb, ub=np.full(F.inputs, np.inf), **others)

    def check(self) -> None:
        check_bounds(self.node, self.lb, self.ub)

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"z": self.start.size}

    def project(self, z: Vector) -> Vector:
        return project_box(z, self.lb, self.ub)

    def slacks(self, point: MiCPPoint) -> dict[str, Vector]:
        return {"w": self.F(point.z)}

    def residuals(self, point: MiCPPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            z = point.z
            defect = box_defect(z, self.F(z), self.lb, self.ub)
            return self.natural(defect, point.finite, bound_violation=norm(z - self.project(z)))
