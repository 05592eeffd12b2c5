"""Nonlinear complementarity problem, Acary's equation (19): find z with 0 ≤ z ⟂ F(z) ≥ 0."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cpbench.formulations.base import Point, Residuals, formulations, map_field, vector_field
from cpbench.formulations.expressions import Map
from cpbench.formulations.nonlinear import NonlinearProblem
from cpbench.foundation.matrices import Vector, max_abs


@dataclass(frozen=True, eq=False)
class NCPPoint(Point):
    """z, shape (n,)."""

    z: Vector


@formulations.register("ncp")
@dataclass(frozen=True, eq=False, kw_only=True)
class NCP(NonlinearProblem):
    """0 ≤ z ⟂ F(z) ≥ 0. Measured: `natural` = ‖min(z, F(z))‖₂ over `scale`; told: pairs of which both are near 0, where
    strict complementarity fails."""

    node: ClassVar[str] = "ncp"
    core: ClassVar[bool] = True
    title: ClassVar[str] = "nonlinear complementarity problem"
    equation: ClassVar[str] = "(19)"
    relations: ClassVar[tuple[str, ...]] = ("0 ≤ z ⟂ F(z) ≥ 0",)
    point_type: ClassVar[type[Point]] = NCPPoint

    F: Map = map_field("n", "n")
    start: Vector = vector_field("n", fill=0.0)

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"z": self.start.size}

    def project(self, z: Vector) -> Vector:
        return np.maximum(z, 0.0)

    def slacks(self, point: NCPPoint) -> dict[str, Vector]:
        return {"w": self.F(point.z)}

    def residuals(self, point: NCPPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            z, w = point.z, self.F(point.z)
            # where both of a pair are 0 an answer is that only to about the square root of its error
            both = np.maximum(np.abs(z) / (max_abs(z) or 1.0), np.abs(w) / (self.scale or 1.0)) <= np.sqrt(tolerance)
            return self.natural(
                np.minimum(z, w),
                point.finite,
                min_z=float(z.min(initial=0.0)),
                min_w=float(w.min(initial=0.0)),
                complementarity=float(abs(z @ w)),
                degenerate_pairs=float(both.sum()),
            )
