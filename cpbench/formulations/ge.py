"""Generalized equation, Acary's equations (27) to (30): 0 ∈ F(z) + N_S(z)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cpbench.formulations.base import Point, Residuals, formulations, map_field, vector_field
from cpbench.formulations.expressions import Map
from cpbench.formulations.variational import SimpleSetProblem
from cpbench.foundation.matrices import Vector, norm


@dataclass(frozen=True, eq=False)
class GEPoint(Point):
    """z, shape (n,)."""

    z: Vector


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

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"z": self.start.size}

    def slacks(self, point: GEPoint) -> dict[str, Vector]:
        return {"w": self.F(point.z)}

    def residuals(self, point: GEPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            z = point.z
            return self.natural(self.defect(z, self.F(z)), point.finite, infeasibility=norm(z - self.project(z)))
