"""Frictional contact → LCP by an inscribed polygon, inner facets (equations (47)-(48)).

Source  u = Wr + q, Coulomb's law with the disk of radius μ r_N.
Target  x = (r_N, β ∈ ℝ^ν, λ) a contact, r_T = Σ β_i d_i, d_i at angle + 2πi/ν:
        0 ≤ r_N ⟂ u_N ≥ 0,  0 ≤ β ⟂ λe + Dᵀu_T ≥ 0,  0 ≤ λ ⟂ μ r_N − eᵀβ ≥ 0.
Lift    r = (r_N, Dβ).        Push  r_T projected on the polygon, β on two vertices, λ = max_i(−d_iᵀu_T).
Kind    approximate: radius too small by up to 1 − cos(π/ν), sliding direction off by up to 180°/ν whatever the
        speed. The error is not monotone in ν: with few facets a direction may be exact by luck.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import facets as polygon
from cpbench.conversions.base import conversions
from cpbench.conversions.facets import PolygonEdge
from cpbench.formulations.base import Kind
from cpbench.formulations.fc import FrictionContact
from cpbench.foundation.matrices import Dense


@conversions.register("fc-lcp-inner")
@dataclass(frozen=True)
class FCtoLCPInner(PolygonEdge):
    """`facets` vertices on the circle, the first at `angle` [rad]. Trace: `W`, `q`, `mu`, for `push`."""

    name = "fc-lcp-inner"
    source = "fc"
    equation = "(47)-(48)"
    kind = Kind.APPROXIMATE
    cost = 4.0

    facets: int = 8
    angle: float = 0.0

    @property
    def vertices(self) -> Dense:
        """d_i as columns, shape (2, ν)."""
        return polygon.directions(self.facets, self.angle)

    def obstacle(self, problem: FrictionContact) -> str | None:
        return polygon.obstacle(problem, self.facets, self.angle)
