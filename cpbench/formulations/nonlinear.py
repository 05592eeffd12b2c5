"""Problems with a nonlinear map F: systems of equations (31), nonlinear complementarity (19), and mixed complementarity
with bounds (20), (21), the 'MCP' of PATH."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from cpbench.formulations.base import (
    Point,
    Problem,
    Residuals,
    formulations,
    map_field,
    point_field,
    scaled,
    vector_field,
)
from cpbench.formulations.expressions import Map
from cpbench.formulations.sizes import check_bounds
from cpbench.foundation.cones import box_defect, project_box
from cpbench.foundation.matrices import Vector, max_abs, norm


class _HasMap:
    """Declared by the nodes, in the order of their data."""

    F: Map
    start: Vector


@dataclass(frozen=True, eq=False, kw_only=True)
class NonlinearProblem(_HasMap, Problem):
    """A problem in terms of F(z). `start` (n,), 0 unless given, is where a solver begins by default.

    `scale` is ‖F(P(0))‖, P the projection on the set of the problem, or ‖F(start)‖ where F is not defined there.
    """

    @classmethod
    def from_casadi(cls, z: Any, F: Any, parameters: Mapping[str, float] | None = None, **others: Any) -> Self:
        """Read CasADi expressions: a column of symbols z and a column F, or a list of its rows, in which other symbols
        are named in `parameters`, with their values. Raises ProblemError."""
        return cls(F=Map.from_casadi(z, F, parameters), **others)

    def project(self, z: Vector) -> Vector:
        """Return P(z), on the part of the set that has a projection in closed form."""
        return z

    @cached_property
    def scale(self) -> float:
        """Size by which errors are divided, of the problem and never of an answer; 0: errors are absolute."""
        with np.errstate(all="ignore"):
            for z in (self.project(np.zeros(self.start.size)), self.start):
                size = norm(self.F(z))
                if np.isfinite(size):
                    return size
        return 0.0

    def natural(self, defect: Vector, finite: bool, **parts: float) -> Residuals:
        """Return ‖defect‖/scale as the one measured number; ∞ where the answer is not `finite`, which a bound would
        clip."""
        absolute = norm(defect) if finite else np.inf
        return Residuals(
            measured={"natural": scaled(absolute, self.scale)},
            parts={"natural_absolute": absolute, **parts},
            flags=() if self.scale > 0 else ("absolute",),
        )


@dataclass(frozen=True, eq=False)
class EquationPoint(Point):
    """z, shape (n,)."""

    z: Vector = point_field("n")


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

    def measure(self, point: EquationPoint, tolerance: float) -> Residuals:
        return self.natural(self.F(point.z), point.finite)


@dataclass(frozen=True, eq=False)
class NCPPoint(Point):
    """z, shape (n,)."""

    z: Vector = point_field("n")


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

    def project(self, z: Vector) -> Vector:
        return np.maximum(z, 0.0)

    def slacks(self, point: NCPPoint) -> dict[str, Vector]:
        return {"w": self.F(point.z)}

    def measure(self, point: NCPPoint, tolerance: float) -> Residuals:
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


@dataclass(frozen=True, eq=False)
class MiCPPoint(Point):
    """z, shape (n,)."""

    z: Vector = point_field("n")


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

    def project(self, z: Vector) -> Vector:
        return project_box(z, self.lb, self.ub)

    def slacks(self, point: MiCPPoint) -> dict[str, Vector]:
        return {"w": self.F(point.z)}

    def measure(self, point: MiCPPoint, tolerance: float) -> Residuals:
        z = point.z
        defect = box_defect(z, self.F(z), self.lb, self.ub)
        return self.natural(defect, point.finite, bound_violation=norm(z - self.project(z)))
