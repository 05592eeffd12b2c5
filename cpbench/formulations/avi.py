"""Affine variational inequality over a polyhedron with bounds: find z ∈ X with (Mz + q)ᵀ(y − z) ≥ 0 for all y ∈ X."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from cpbench import matrices
from cpbench.cones import project_box
from cpbench.formulations.base import (
    Point,
    Problem,
    Residuals,
    formulations,
    matrix_field,
    scaled,
    vector_field,
)
from cpbench.formulations.box import box_residuals, check_bounds
from cpbench.matrices import Matrix, Vector, max_abs, norm


@dataclass(frozen=True, eq=False)
class AVIPoint(Point):
    """z (n,), λ ≥ 0 of Az ≥ b (m,), μ of Cz = d (k,)."""

    z: Vector
    lam: Vector = field(default_factory=lambda: np.zeros(0))
    mu: Vector = field(default_factory=lambda: np.zeros(0))


@formulations.register("avi")
@dataclass(frozen=True, eq=False, kw_only=True)
class AVI(Problem):
    """X = {z : Az ≥ b, Cz = d, lb ≤ z ≤ ub}, each part of which may be left out; −(Mz + q) ∈ N_X(z).

    With multipliers: F = Mz + q − Aᵀλ − Cᵀμ satisfies z = P_[lb,ub](z − F), 0 ≤ λ ⟂ Az − b ≥ 0, Cz = d; for a box
    alone that is the natural map. The multipliers are part of an answer: without them, every measurement
    would have to project on a polyhedron, which is a program of its own. Judged: `natural`, the norm of all that over
    ‖(q, b, d)‖; `unit_free`, the same with every part over its own size.
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
    def symmetric(self) -> bool:
        return matrices.is_symmetric(self.M)

    @cached_property
    def monotone(self) -> bool:
        """M + Mᵀ positive semidefinite."""
        return matrices.is_psd(self.M)

    def slacks(self, point: AVIPoint) -> dict[str, Vector]:
        return {"w": self.M @ point.z + self.q - self.A.T @ point.lam - self.C.T @ point.mu}

    def residuals(self, point: AVIPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            z, lam = point.z, point.lam
            Mz, At, Ct = self.M @ z, self.A.T @ lam, self.C.T @ point.mu
            Az, Cz = self.A @ z, self.C @ z
            F = Mz + self.q - At - Ct
            rows, equality = Az - self.b, Cz - self.d
            box = z - project_box(z - F, self.lb, self.ub)
            natural = norm(np.concatenate([box, np.minimum(lam, rows), equality]))
            data = norm(np.concatenate([self.q, self.b, self.d]))
            bounds = np.concatenate([self.lb[np.isfinite(self.lb)], self.ub[np.isfinite(self.ub)]])
            z_scale = max(max_abs(z), max_abs(bounds), max_abs(self.q) / (max_abs(self.M) or 1.0))
            forces = max(map(max_abs, (self.q, Mz, At, Ct)))
            judged = {
                "natural": scaled(natural, data),
                "unit_free": box_residuals(z, F, self.lb, self.ub, z_scale, forces),
            }
            if self.b.size:
                row_scale = max(max_abs(Az), max_abs(self.b))
                zero = np.zeros_like(lam)
                judged["complementarity"] = box_residuals(
                    rows, lam, zero, np.full_like(lam, np.inf), row_scale, max(max_abs(lam), forces)
                )
            if self.d.size:
                judged["equality"] = scaled(norm(equality), norm(Cz), norm(self.d))
            return Residuals(
                judged=judged,
                parts={
                    "natural_absolute": natural,
                    "infeasibility": norm(
                        np.concatenate([z - project_box(z, self.lb, self.ub), np.minimum(rows, 0.0), equality])
                    ),
                },
                flags=() if data > 0 else ("absolute",),
            )
