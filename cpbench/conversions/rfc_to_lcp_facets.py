"""Rolling frictional contact → LCP by inscribed polygons for forces and moments.

Source  u = Wr + q, rolling contact law with disks of radius μ r_N and μ_r r_N.
Target  x = (r_N, β ∈ ℝ^ν, λ, γ ∈ ℝ^ν, κ) a contact, r_T = Dβ,  m = Dγ, d_i at angle + 2πi/ν:
        0 ≤ r_N ⟂ u_N ≥ 0,  0 ≤ β ⟂ λe + Dᵀu_T ≥ 0,  0 ≤ λ ⟂ μ r_N − eᵀβ ≥ 0,
                            0 ≤ γ ⟂ κe + Dᵀω ≥ 0,    0 ≤ κ ⟂ μ_r r_N − eᵀγ ≥ 0.
Lift    r = (r_N, Dβ, Dγ).        Push  r_T and m projected on their polygons, λ = max_i(−d_iᵀu_T), κ = max_i(−d_iᵀω).
Kind    approximate: radii too small by up to 1 − cos(π/ν), directions off by up to 180°/ν whatever the speed.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import facets as polygon
from cpbench.conversions.base import conversions
from cpbench.conversions.facets import PolygonEdge
from cpbench.formulations.base import Kind
from cpbench.formulations.rfc import RollingFrictionContact
from cpbench.foundation.matrices import Dense


@conversions.register("rfc-lcp-facets")
@dataclass(frozen=True)
class RFCtoLCPFacets(PolygonEdge):
    """`facets` vertices on both circles, the first at `angle` [rad]. Trace: `W`, `q`, `mu`, `mu_r`, for `push`."""

    name = "rfc-lcp-facets"
    source = "rfc"
    equation = "(47)-(48), rolling"
    kind = Kind.APPROXIMATE
    cost = 4.0

    facets: int = 8
    angle: float = 0.0

    @property
    def vertices(self) -> Dense:
        """d_i as columns, shape (2, ν)."""
        return polygon.directions(self.facets, self.angle)

    def obstacle(self, problem: RollingFrictionContact) -> str | None:
        wrong = polygon.wrong_knobs(self.facets, self.angle)
        if wrong is None and problem.dimension != 5:
            return f"a contact has {problem.dimension} rows, where the law is an LCP exactly; use rfc-lcp-2d"
        return wrong
