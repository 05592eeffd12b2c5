"""A system of equations F(z) = 0, smooth or only piecewise so: what complementarity problems are turned into (31)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cpbench.formulations.base import Point, Residuals, formulations, map_field, vector_field
from cpbench.formulations.expressions import Map
from cpbench.formulations.nonlinear import NonlinearProblem
from cpbench.foundation.matrices import Vector


@dataclass(frozen=True, eq=False)
class EquationPoint(Point):
    """z, shape (n,)."""

    z: Vector


@formulations.register("equation")
@dataclass(frozen=True, eq=False, kw_only=True)
class Equation(NonlinearProblem):
    """F(z) = 0. Measured: `natural` = ‖F(z)‖₂ over `scale`."""

    node: ClassVar[str] = "equation"
    title: ClassVar[str] = "system of equations"
    equation: ClassVar[str] = "(31)"
    relations: ClassVar[tuple[str, ...]] = ("F(z) = 0",)
    point_type: ClassVar[type[Point]] = EquationPoint

    F: Map = map_field("n", "n")
    start: Vector = vector_field("n", fill=0.0)

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"z": self.start.size}

    def residuals(self, point: EquationPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            return self.natural(self.F(point.z), point.finite)
