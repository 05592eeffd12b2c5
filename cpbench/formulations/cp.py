"""Cone complementarity problem, Acary's equation (17): K ∋ x ⟂ F(x) ∈ K*."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from cpbench.errors import ProblemError
from cpbench.formulations.base import Point, Residuals, formulations, map_field, matrix_field, vector_field
from cpbench.formulations.conic import ConicProblem
from cpbench.formulations.defects import cone_defect
from cpbench.formulations.expressions import Map
from cpbench.formulations.nonlinear import NonlinearProblem
from cpbench.foundation.matrices import Matrix, Vector, norm


@dataclass(frozen=True, eq=False)
class CPPoint(Point):
    """x (n,), λ ≥ 0 of the rows of the polyhedral cone Ax ≥ 0 (m,)."""

    x: Vector
    lam: Vector = field(default_factory=lambda: np.zeros(0))


@formulations.register("cp")
@dataclass(frozen=True, eq=False, kw_only=True)
class CP(NonlinearProblem, ConicProblem):
    """C ∋ x ⟂ F(x) ∈ C* with C = {x ∈ K : Ax ≥ 0}, so that C* = K* + Aᵀℝ₊ᵐ (closed where K is polyhedral, or where
    some x inside K has Ax > 0).

    K is a product of {0}, ℝ, ℝ₊, second-order and rolling cones and their duals. With G = F(x) − Aᵀλ: x = P_K(x − G)
    and 0 ≤ λ ⟂ Ax ≥ 0. Measured: `natural`, the norm of both over `scale`.
    """

    node: ClassVar[str] = "cp"
    title: ClassVar[str] = "cone complementarity problem"
    equation: ClassVar[str] = "(17)"
    relations: ClassVar[tuple[str, ...]] = ("C ∋ x ⟂ F(x) ∈ C*", "C = {x ∈ K : Ax ≥ 0}")
    point_type: ClassVar[type[Point]] = CPPoint
    cone_rows: ClassVar[str] = "start"

    F: Map = map_field("n", "n")
    A: Matrix = matrix_field("m", "n", optional=True)
    cone_kind: Vector = vector_field("c")
    cone_size: Vector = vector_field("c")
    cone_mu: Vector = vector_field("c", finite=False)
    cone_mu_r: Vector = vector_field("c", fill=0.0)
    start: Vector = vector_field("n", fill=0.0)

    def check(self) -> None:
        super().check()
        if not self.K.conical:
            raise ProblemError("cp.cone_kind", "has a disk or a ball, which is not a cone; use vi")

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"x": self.start.size, "lam": self.A.shape[0]}

    def project(self, z: Vector) -> Vector:
        return self.K.project(z)

    def slacks(self, point: CPPoint) -> dict[str, Vector]:
        return {"y": self.F(point.x)}

    def residuals(self, point: CPPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            x, y = point.x, self.F(point.x)
            defect = [cone_defect(self.K, x, y - self.A.T @ point.lam), np.minimum(point.lam, self.A @ x)]
            return self.natural(
                np.concatenate(defect),
                point.finite,
                cone_violation=norm(x - self.K.project(x)),
                complementarity=abs(float(x @ y)),
            )
