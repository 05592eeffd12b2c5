"""Linear complementarity problem, Acary's equation (13): find z with 0 ≤ z ⟂ w = Mz + q ≥ 0."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

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
from cpbench.foundation.matrices import Matrix, Vector, max_abs, norm


@dataclass(frozen=True, eq=False)
class LCPPoint(Point):
    """z, shape (n,)."""

    z: Vector


@formulations.register("lcp")
@dataclass(frozen=True, eq=False, kw_only=True)
class LCP(AffineProblem):
    """0 ≤ z ⟂ Mz + q ≥ 0.

    Residuals (both measured): `natural` = ‖min(z, w)‖₂/‖q‖₂, Siconos' lcp_compute_error, and `unit_free` =
    ‖min(z/max(‖z‖∞, ‖q‖∞/max|M|), w/max(‖q‖∞, ‖Mz‖∞))‖₂, which does not change with the units of z or w. Without
    ‖q‖∞/max|M|, the size of a z that could balance q, an answer a rounding error away from z = 0 would have error 1.
    """

    node: ClassVar[str] = "lcp"
    core: ClassVar[bool] = True
    title: ClassVar[str] = "linear complementarity problem"
    equation: ClassVar[str] = "(13)"
    relations: ClassVar[tuple[str, ...]] = ("0 ≤ z ⟂ w = Mz + q ≥ 0",)
    point_type: ClassVar[type[Point]] = LCPPoint
    terms: ClassVar[tuple[Term, ...]] = (("q", 1, "M", "z"),)

    M: Matrix = matrix_field("n", "n")
    q: Vector = vector_field("n")

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"z": self.q.size}

    @cached_property
    def z_unit(self) -> float:
        """‖q‖∞/max|M|, the least size of a z that can balance q (‖q‖∞ for M = 0)."""
        return max_abs(self.q) / (max_abs(self.M) or 1.0)

    def slacks(self, point: LCPPoint) -> dict[str, Vector]:
        return {"w": self.M @ point.z + self.q}

    def residuals(self, point: LCPPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            z, Mz = point.z, self.M @ point.z
            w = Mz + self.q
            natural, size, largest = norm(np.minimum(z, w)), norm(self.q), max_abs(self.q)
            return Residuals(
                measured={
                    "natural": scaled(natural, size),
                    "unit_free": natural
                    if not largest
                    else unit_free_complementarity(z, w, max(max_abs(z), self.z_unit), max(largest, max_abs(Mz))),
                },
                parts={
                    "natural_absolute": natural,
                    "min_z": float(z.min(initial=0.0)),
                    "min_w": float(w.min(initial=0.0)),
                    "complementarity": float(abs(z @ w)),
                },
                flags=() if size > 0 else ("absolute",),
            )

    def certifies_infeasibility(self, certificate: Vector) -> bool:
        """Return whether y is a proof of Farkas: y ≥ 0, Mᵀy ≤ 0, qᵀy < 0 exclude every z ≥ 0 with Mz + q ≥ 0 (to
        rounding: 1e-12)."""
        y = np.maximum(certificate, 0.0)
        if y.size != self.q.size or not np.isfinite(y).all() or not y.any():
            return False
        y = y / y.max()
        My = self.M.T @ y
        rounding = 1e-12 * (abs(self.M).T @ y)  # of each column by itself: a small column may decide
        return bool((My <= rounding).all() and self.q @ y < -1e-9 * max(max_abs(self.q), 1e-300))


def unit_free_complementarity(z: Vector, w: Vector, z_scale: float, w_scale: float) -> float:
    """Return ‖min(z/z_scale, w/w_scale)‖₂ with 0/0 = 0; z and w (n,), the scales are numbers, the result has no
    unit."""
    return norm(np.minimum(z / z_scale if z_scale > 0 else z, w / w_scale if w_scale > 0 else w))
