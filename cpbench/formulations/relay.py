"""Relay problem: an affine variational inequality over a finite box, −(Mz + q) ∈ N_[lb,ub](z)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations.affine import AffineProblem
from cpbench.formulations.base import Point, Residuals, Term, formulations, matrix_field, vector_field
from cpbench.formulations.box import box_residuals, check_bounds, largest_in_box, own_scale, top
from cpbench.formulations.lcp import LCPPoint
from cpbench.formulations.sizes import least, ratio
from cpbench.foundation.cones import box_defect, project_box
from cpbench.foundation.matrices import Matrix, Vector, max_abs, norm


@formulations.register("relay")
@dataclass(frozen=True, eq=False, kw_only=True)
class Relay(AffineProblem):
    """w = Mz + q, lb ≤ z ≤ ub finite: w ≥ 0 where z = lb, w ≤ 0 where z = ub, w = 0 between, any w where lb = ub.

    Measured: `natural` = ‖z − P_[lb,ub](z − w)‖/(1 + ‖q‖), and `unit_free`, the same with z and w over their own sizes:
    max(‖z‖∞, z_unit) and max(‖q‖∞, ‖Mz‖∞, max|M| z_unit), over the unknowns that can move.
    """

    node: ClassVar[str] = "relay"
    title: ClassVar[str] = "relay problem"
    equation: ClassVar[str] = "(22), affine over a box"
    relations: ClassVar[tuple[str, ...]] = ("w = Mz + q", "lb ≤ z ≤ ub", "−w ∈ N_[lb,ub](z)")
    point_type: ClassVar[type[Point]] = LCPPoint
    terms: ClassVar[tuple[Term, ...]] = (("q", 1, "M", "z"),)

    M: Matrix = matrix_field("n", "n")
    q: Vector = vector_field("n")
    lb: Vector = vector_field("n")
    ub: Vector = vector_field("n")

    def check(self) -> None:
        check_bounds(self.node, self.lb, self.ub)

    @property
    def point_sizes(self) -> dict[str, int]:
        return {"z": self.q.size}

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """Whether lb < ub, so that the unknown is not fixed, shape (n,)."""
        return self.lb < self.ub

    @cached_property
    def z_unit(self) -> float:
        """The lesser of ‖q‖∞/max|M|, a z that balances q, and the largest z in the box.

        Bounds alone would not do: a bound of 1e20 stands for none. Nor would q: forces may be beyond any z allowed.
        """
        box = largest_in_box(self.lb, self.ub, self.moving)
        return least(ratio(top(self.q, self.moving), max_abs(self.M)), box)

    def slacks(self, point: LCPPoint) -> dict[str, Vector]:
        return {"w": self.M @ point.z + self.q}

    def residuals(self, point: LCPPoint, tolerance: float = 1e-6) -> Residuals:
        self.check_point(point)
        with np.errstate(all="ignore"):
            z, Mz = point.z, self.M @ point.z
            w = Mz + self.q
            natural = norm(box_defect(z, w, self.lb, self.ub))
            z_scale = own_scale(max(top(z, self.moving), self.z_unit), self.lb, self.moving)
            w_scale = max(top(self.q, self.moving), top(Mz, self.moving), max_abs(self.M) * self.z_unit)
            return Residuals(
                measured={
                    "natural": natural / (1.0 + norm(self.q)),
                    "unit_free": box_residuals(z, w, self.lb, self.ub, z_scale, w_scale),
                },
                parts={
                    "natural_absolute": natural,
                    "infeasibility": norm(z - project_box(z, self.lb, self.ub)),
                },
            )
