"""Variational inequality, Acary's equation (22): find z ∈ X with F(z)ᵀ(y − z) ≥ 0 for all y ∈ X."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cpbench.formulations.base import Point, formulations, map_field, matrix_field, vector_field
from cpbench.formulations.expressions import Map
from cpbench.formulations.variational import RowsProblem, VIPoint
from cpbench.foundation.matrices import Matrix, Vector


@formulations.register("vi")
@dataclass(frozen=True, eq=False, kw_only=True)
class VI(RowsProblem):
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

    @property
    def point_sizes(self) -> dict[str, int]:
        return super().point_sizes | {"nu": self.g.rows}

    def force(self, point: VIPoint) -> Vector:
        G = super().force(point)
        return G - self.g.jacobian(point.z).T @ point.nu if self.g.rows else G

    def row_defects(self, point: VIPoint) -> list[Vector]:
        rows = super().row_defects(point)
        return [*rows, np.minimum(point.nu, self.g(point.z))] if self.g.rows else rows
