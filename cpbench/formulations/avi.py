"""Affine variational inequality over a polyhedron with bounds: find z ∈ X with (Mz + q)ᵀ(y − z) ≥ 0 for all y ∈ X."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.affine import AffineProblem
from cpbench.formulations.base import (
    Point,
    Residuals,
    Term,
    formulations,
    matrix_field,
    scaled,
    vector_field,
)
from cpbench.formulations.box import box_residuals, check_bounds, largest_in_box, own_scale, top
from cpbench.formulations.sizes import least, ratio, row_sizes
from cpbench.foundation.cones import box_defect, project_box
from cpbench.foundation.matrices import Matrix, Vector, max_abs, norm


@dataclass(frozen=True, eq=False)
class AVIPoint(Point):
    """z (n,), λ ≥ 0 of Az ≥ b (m,), μ of Cz = d (k,)."""

    z: Vector
    lam: Vector = field(default_factory=lambda: np.zeros(0))
    mu: Vector = field(default_factory=lambda: np.zeros(0))


@formulations.register("avi")
@dataclass(frozen=True, eq=False, kw_only=True)
class AVI(AffineProblem):
    """X = {z : Az ≥ b, Cz = d, lb ≤ z ≤ ub}, each part of which may be left out; −(Mz + q) ∈ N_X(z).

    With multipliers: F = Mz + q − Aᵀλ − Cᵀμ satisfies z = P_[lb,ub](z − F), 0 ≤ λ ⟂ Az − b ≥ 0, Cz = d; for a box
    alone that is the natural map. The multipliers are part of an answer: without them, every measurement
    would have to project on a polyhedron, which is a separate program. Measured: `natural`, the norm of all that over
    ‖(q, b, d, lb where it is ub)‖; and without units, every row of A and C divided by its largest entry: `unit_free`,
    the box part with z over max(‖z‖∞, z_unit) and F over forces = max(‖q‖∞, ‖Mz‖∞, max|M| z_unit); `complementarity`,
    min(λ, Az − b) with λ over forces and a row over max(|b_i|, the scale of z); `equality`, Cz − d in the same way.
    The scales leave out multipliers (they may be large and cancel), rows of others (they may be idle) and unknowns
    with lb = ub.
    """

    node: ClassVar[str] = "avi"
    title: ClassVar[str] = "affine variational inequality"
    equation: ClassVar[str] = "(22), affine"
    relations: ClassVar[tuple[str, ...]] = (
        "X = {z : Az ≥ b, Cz = d, lb ≤ z ≤ ub}",
        "z ∈ X",
        "(Mz + q)ᵀ(y − z) ≥ 0 for all y ∈ X",
    )
    point_type: ClassVar[type[Point]] = AVIPoint
    primal: ClassVar[str] = "z"
    terms: ClassVar[tuple[Term, ...]] = (
        ("q", 1, "M", "z"),
        ("q", -1, "Aᵀ", "lam"),
        ("q", -1, "Cᵀ", "mu"),
        ("b", -1, "A", "z"),
        ("d", -1, "C", "z"),
    )

    M: Matrix = matrix_field("n", "n")
    q: Vector = vector_field("n")
    A: Matrix = matrix_field("m", "n", optional=True)
    b: Vector = vector_field("m", fill=0.0)
    C: Matrix = matrix_field("k", "n", optional=True)
    d: Vector = vector_field("k", fill=0.0)
    lb: Vector = vector_field("n", finite=False, fill=-np.inf)
    ub: Vector = vector_field("n", finite=False, fill=np.inf)

    def check(self) -> None:
        check_bounds(self.node, self.lb, self.ub)

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"z": self.q.size, "lam": self.b.size, "mu": self.d.size}

    @property
    def only_box(self) -> bool:
        """No rows beside the bounds."""
        return not (self.b.size or self.d.size)

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """lb < ub."""
        return self.lb < self.ub

    @cached_property
    def z_unit(self) -> float:
        """The least of ‖q‖∞/max|M|, the largest z in the box, and the z that b and d ask for; 0 without any."""
        return least(
            ratio(top(self.q, self.moving), max_abs(self.M)),
            largest_in_box(self.lb, self.ub, self.moving),
            max_abs(self.b / row_sizes(self.A)),
            max_abs(self.d / row_sizes(self.C)),
        )

    def slacks(self, point: AVIPoint) -> dict[str, Vector]:
        return {"w": self.M @ point.z + self.q - self.A.T @ point.lam - self.C.T @ point.mu}

    def residuals(self, point: AVIPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            z, lam = point.z, point.lam
            Mz = self.M @ z
            F = Mz + self.q - self.A.T @ lam - self.C.T @ point.mu
            rows, equality = self.A @ z - self.b, self.C @ z - self.d
            box = box_defect(z, F, self.lb, self.ub)
            natural = norm(np.concatenate([box, np.minimum(lam, rows), equality]))
            if not point.finite:  # which the bounds would clip
                natural = np.inf
            data = norm(np.concatenate([self.q, self.b, self.d, self.lb[~self.moving]]))
            measured = {"natural": scaled(natural, data)}
            if self.z_unit > 0:
                measured |= self._without_units(z, F, Mz, lam, rows, equality)
            return Residuals(
                measured=measured,
                parts={
                    "natural_absolute": natural,
                    "infeasibility": norm(
                        np.concatenate([z - project_box(z, self.lb, self.ub), np.minimum(rows, 0.0), equality])
                    ),
                },
                flags=() if data > 0 else ("absolute",),
            )

    def _without_units(
        self, z: Vector, F: Vector, Mz: Vector, lam: Vector, rows: Vector, equality: Vector
    ) -> dict[str, float]:
        z_scale = max(top(z, self.moving), self.z_unit)
        forces = max(top(self.q, self.moving), top(Mz, self.moving), max_abs(self.M) * self.z_unit) or 1.0
        own = own_scale(z_scale, self.lb, self.moving)
        measured = {"unit_free": box_residuals(z, F, self.lb, self.ub, own, forces)}
        if self.b.size:
            sizes = row_sizes(self.A)
            row_scale = np.maximum(np.abs(self.b) / sizes, z_scale)
            measured["complementarity"] = norm(np.minimum(rows / sizes / row_scale, lam * sizes / forces))
        if self.d.size:
            sizes = row_sizes(self.C)
            measured["equality"] = norm(equality / sizes / np.maximum(np.abs(self.d) / sizes, z_scale))
        return measured
