"""Quadratic program over a product of cones: min ½xᵀQx + pᵀx subject to Ax + b ∈ K."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from cpbench.errors import ProblemError
from cpbench.formulations.base import Point, Residuals, Term, formulations, matrix_field, scaled, vector_field
from cpbench.formulations.conic import ConicProblem, cone_fields, cone_residuals
from cpbench.formulations.defects import cone_defect
from cpbench.formulations.sizes import group_max, least, ratio, row_sizes
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector, freeze, max_abs, norm
from cpbench.foundation.product_cones import Cone, ProductCone


@dataclass(frozen=True, eq=False)
class ConeQPPoint(Point):
    """x, shape (n,), and the multiplier y of Ax + b ∈ K, shape (m,)."""

    x: Vector
    y: Vector


@formulations.register("coneqp")
@dataclass(frozen=True, eq=False, kw_only=True)
class ConeQP(ConicProblem):
    """min ½xᵀQx + pᵀx subject to s = Ax + b ∈ K, Q symmetric; Qx + p = Aᵀy, K ∋ s ⟂ y ∈ K*.

    K may have factors ℝ₊ × disk, which are convex and no cones; there the conditions are −y ∈ N_K(s), of which
    s = P_K(s − y) is the general form. Measured: `natural` = ‖(Qx + p − Aᵀy, s − P_K(s − y))‖/‖(p, b)‖; `stationarity`
    = ‖Qx + p − Aᵀy‖/max(‖Qx‖, ‖p‖, ‖Aᵀy‖, max|Q| x_unit); `unit_free`, the cone part with every factor (every row
    of ℝ₊) divided by its largest entry in A, then s over max(|b|, ‖x‖∞, x_unit) of the factor and y over forces =
    max(‖p‖∞, ‖Qx‖∞, max|Q| x_unit): neither a large b of an idle factor nor large multipliers that cancel may set a
    scale. When Q
    is not positive semidefinite, the flag `stationary` says that these conditions are not sufficient.
    """

    node: ClassVar[str] = "coneqp"
    title: ClassVar[str] = "cone quadratic program"
    equation: ClassVar[str] = "(1) over a cone"
    relations: ClassVar[tuple[str, ...]] = ("min ½xᵀQx + pᵀx", "Ax + b ∈ K")
    point_type: ClassVar[type[Point]] = ConeQPPoint
    primal: ClassVar[str] = "x"
    terms: ClassVar[tuple[Term, ...]] = (("p", 1, "Q", "x"), ("p", -1, "Aᵀ", "y"), ("b", 1, "A", "x"))
    cone_rows: ClassVar[str] = "b"

    Q: Matrix = matrix_field("n", "n")
    p: Vector = vector_field("n")
    A: Matrix = matrix_field("m", "n")
    b: Vector = vector_field("m", fill=0.0)
    cone_kind: Vector = vector_field("k")
    cone_size: Vector = vector_field("k")
    cone_mu: Vector = vector_field("k", finite=False)
    cone_mu_r: Vector = vector_field("k", fill=0.0)

    @classmethod
    def over(cls, Q: Matrix, p: Vector, K: ProductCone, A: Matrix | None = None, b: Vector | None = None) -> ConeQP:
        """Return the program with K given as a product; A = I and b = 0 unless given."""
        if A is None:
            A = matrices.identity(np.size(p), Q)
        return cls(Q=Q, p=p, A=A, b=b, **cone_fields(K))  # pyright: ignore[reportArgumentType]

    def check(self) -> None:
        super().check()
        if not matrices.is_symmetric(self.Q, 1e-10):
            raise ProblemError(
                "coneqp.Q", f"is not symmetric, asymmetry = {matrices.asymmetry(self.Q):.1e}; use soclcp"
            )

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"x": self.p.size, "y": self.b.size}

    @cached_property
    def convex(self) -> bool:
        """Q positive semidefinite (matrices.is_psd)."""
        return matrices.is_psd(self.Q)

    @cached_property
    def plain(self) -> bool:
        """A = I and b = 0: x itself is in K."""
        if self.A.shape[0] != self.A.shape[1] or self.b.any():
            return False
        return matrices.max_abs(self.A - matrices.identity(self.p.size, self.A)) == 0.0

    @cached_property
    def block_sizes(self) -> Vector:
        """max|A| over the rows of each factor, 1 where that is 0; shape (m,)."""
        return freeze(row_sizes(self.A, self.K.blocks))

    @cached_property
    def block_data(self) -> Vector:
        """max|b| over each factor and its size: the x that it asks for; shape (m,)."""
        if not self.b.size:
            return self.b
        return freeze(group_max(self.b, self.K.blocks)[self.K.blocks] / self.block_sizes)

    @cached_property
    def x_unit(self) -> float:
        """The lesser of ‖p‖∞/max|Q|, an x that balances p, and the x that b asks for; 0 without any."""
        bounded = np.repeat(self.K.kind != Cone.FREE, self.K.size.astype(np.int64))
        return least(ratio(max_abs(self.p), max_abs(self.Q)), max_abs(self.block_data[bounded]))

    def objective(self, x: Vector) -> float:
        return float(0.5 * x @ (self.Q @ x) + self.p @ x)

    def slacks(self, point: ConeQPPoint) -> dict[str, Vector]:
        return {"s": self.A @ point.x + self.b}

    def residuals(self, point: ConeQPPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            x, y = point.x, point.y
            Qx, Aty = self.Q @ x, self.A.T @ y
            s = self.A @ x + self.b
            stationarity = Qx + self.p - Aty
            cone_part = norm(cone_defect(self.K, s, y))
            natural = norm(np.array([norm(stationarity), cone_part]))
            if not point.finite:  # which a projection would clip
                natural = np.inf
            data = norm(np.concatenate([self.p, self.b]))
            measured = {"natural": scaled(natural, data)}
            balance = max(norm(self.p), max_abs(self.Q) * self.x_unit)
            if balance > 0:
                measured["stationarity"] = norm(stationarity) / max(norm(Qx), norm(Aty), balance)
            if self.x_unit > 0:
                forces = max(max_abs(self.p), max_abs(Qx), max_abs(self.Q) * self.x_unit) or 1.0
                s_scale = np.maximum(self.block_data, max(max_abs(x), self.x_unit)) * self.block_sizes
                measured["unit_free"] = cone_residuals(self.K, s, y, s_scale, forces / self.block_sizes)
            return Residuals(
                measured=measured,
                parts={
                    "natural_absolute": natural,
                    "stationarity_absolute": norm(stationarity),
                    "cone_violation": norm(s - self.K.project(s)),
                    "complementarity": abs(float(s @ y)),
                    "objective": self.objective(x),
                },
                flags=(("absolute",) if data == 0 else ()) + (() if self.convex else ("stationary",)),
            )
