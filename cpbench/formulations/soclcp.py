"""Linear complementarity over a cone (second-order cone LCP): K ∋ x ⟂ Mx + q ∈ K*."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cpbench.errors import ProblemError
from cpbench.formulations.affine import AffineProblem
from cpbench.formulations.base import Point, Residuals, Term, formulations, matrix_field, scaled, vector_field
from cpbench.formulations.conic import ConicProblem, cone_residuals
from cpbench.formulations.defects import cone_defect
from cpbench.foundation.matrices import Matrix, Vector, max_abs, norm


@dataclass(frozen=True, eq=False)
class SOCLCPPoint(Point):
    """x, shape (n,)."""

    x: Vector


@formulations.register("soclcp")
@dataclass(frozen=True, eq=False, kw_only=True)
class SOCLCP(AffineProblem, ConicProblem):
    """K ∋ x ⟂ w = Mx + q ∈ K*, K a product of cones: {0}, ℝ, ℝ₊, second-order, rolling and their duals.

    Measured: `natural` = ‖x − P_K(x − w)‖/‖q‖, and `unit_free`, the same with x over max(‖x‖∞, ‖q‖∞/max|M|) and
    w over max(‖q‖∞, ‖Mx‖∞), both over components where K is more than {0}: elsewhere w may be anything.
    """

    node: ClassVar[str] = "soclcp"
    title: ClassVar[str] = "second-order cone linear complementarity problem"
    equation: ClassVar[str] = "(17)"
    relations: ClassVar[tuple[str, ...]] = ("K ∋ x ⟂ w = Mx + q ∈ K*",)
    point_type: ClassVar[type[Point]] = SOCLCPPoint
    terms: ClassVar[tuple[Term, ...]] = (("q", 1, "M", "x"),)
    cone_rows: ClassVar[str] = "q"

    M: Matrix = matrix_field("n", "n")
    q: Vector = vector_field("n")
    cone_kind: Vector = vector_field("k")
    cone_size: Vector = vector_field("k")
    cone_mu: Vector = vector_field("k", finite=False)
    cone_mu_r: Vector = vector_field("k", fill=0.0)

    def check(self) -> None:
        super().check()
        if not self.K.conical:
            raise ProblemError("soclcp.cone_kind", "has a cylinder ℝ₊ × disk, which is not a cone; use coneqp")

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"x": self.q.size}

    def slacks(self, point: SOCLCPPoint) -> dict[str, Vector]:
        return {"w": self.M @ point.x + self.q}

    def residuals(self, point: SOCLCPPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            x, Mx = point.x, self.M @ point.x
            w = Mx + self.q
            natural = norm(cone_defect(self.K, x, w))
            measured = {"natural": scaled(natural, norm(self.q))}
            felt = self.K.extended
            q_size = max_abs(self.q[felt])
            if q_size > 0:
                x_scale = max(max_abs(x), q_size / (max_abs(self.M) or 1.0))
                measured["unit_free"] = cone_residuals(self.K, x, w, x_scale, max(q_size, max_abs(Mx[felt])))
            return Residuals(
                measured=measured,
                parts={
                    "natural_absolute": natural,
                    "cone_violation": norm(x - self.K.project(x)),
                    "dual_violation": norm(w - self.K.project_dual(w)),
                    "complementarity": abs(float(x @ w)),
                },
                flags=() if self.q.any() else ("absolute",),
            )
