"""Base of the conic nodes: a product K of closed convex factors, stored as four vectors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from cpbench.errors import ProblemError
from cpbench.formulations.base import Problem
from cpbench.formulations.defects import cone_defect
from cpbench.foundation.matrices import Vector, norm
from cpbench.foundation.product_cones import Cone, ProductCone


class _HasCone:
    """The four vectors are declared by the nodes, after their matrices."""

    cone_kind: Vector
    cone_size: Vector
    cone_mu: Vector
    cone_mu_r: Vector


@dataclass(frozen=True, eq=False, kw_only=True)
class ConicProblem(_HasCone, Problem):
    """A problem over K = K₁ × … × K_k; factor i has kind `cone_kind[i]` (numbers of `Cone`) and `cone_size[i]` rows."""

    cone_rows: ClassVar[str]
    """Name of the vector with one number a row of K."""
    cone_kinds: ClassVar[tuple[Cone, ...]] = tuple(c for c in Cone if c is not Cone.BALL)

    def check(self) -> None:
        kind, size = self.cone_kind, self.cone_size
        known = ", ".join(f"{c.value} {c.name.lower()}" for c in self.cone_kinds)
        rolling = np.isin(kind, (Cone.ROLLING, Cone.ROLLING_DUAL))
        pointed = np.isin(kind, (Cone.SECOND_ORDER, Cone.CYLINDER))
        for field, bad, expected in (
            ("cone_kind", ~np.isin(kind, self.cone_kinds), f"one of {known}"),
            ("cone_size", (size < 0) | (size != np.floor(size)), "a number of rows"),
            ("cone_size", rolling & ~np.isin(size, (3, 5)), "3 or 5 rows of a rolling cone"),
            ("cone_size", pointed & (size < 1), "a normal component at least"),
            ("cone_mu", self.cone_mu < 0, "a coefficient of at least 0"),
            ("cone_mu_r", self.cone_mu_r < 0, "a coefficient of at least 0"),
        ):
            if bad.any():
                i = int(np.flatnonzero(bad)[0])
                value = getattr(self, field)[i]
                raise ProblemError(f"{self.node}.{field}", f"is {value:g} at factor {i}, expected {expected}")
        rows = getattr(self, self.cone_rows).size
        if size.sum() != rows:
            raise ProblemError(f"{self.node}.cone_size", f"adds up to {size.sum():g}, {self.cone_rows} has {rows}")

    @cached_property
    def K(self) -> ProductCone:
        """The product of the factors."""
        return ProductCone(self.cone_kind, self.cone_size, self.cone_mu, self.cone_mu_r)


def cone_fields(K: ProductCone) -> Mapping[str, Vector]:
    """Return K as the four data vectors of a conic node: kind, size, μ and μ_r of its runs of equal factors."""
    return {"cone_kind": K.kind, "cone_size": K.size, "cone_mu": K.mu, "cone_mu_r": K.mu_r}


def cone_residuals(K: ProductCone, s: Vector, y: Vector, s_scale: float | Vector, y_scale: float | Vector) -> float:
    """Return ‖(s − P_K(s − ρy))/σ_s‖ with ρ = σ_s/σ_y, which does not change with the units of s and y.

    The scales are numbers, or vectors that are constant on every factor, positive.
    """
    return norm(cone_defect(K, s, (s_scale / y_scale) * y) / s_scale)
