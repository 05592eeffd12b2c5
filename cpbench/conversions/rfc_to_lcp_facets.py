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
from cpbench.conversions import rolling_facets
from cpbench.conversions.base import Conversion, Size, conversions
from cpbench.conversions.operators import ContactOperator
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.formulations.rfc import RollingFrictionContact
from cpbench.matrices import Dense


@conversions.register("rfc-lcp-facets")
@dataclass(frozen=True)
class RFCtoLCPFacets(Conversion):
    """`facets` vertices on both circles, the first at `angle` [rad]. Trace: `W`, `q`, `mu`, `mu_r`, for `push`."""

    name = "rfc-lcp-facets"
    source = "rfc"
    target = "lcp"
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

    def apply(self, problem: RollingFrictionContact) -> tuple[LCP, Trace]:
        self.require(problem)
        return rolling_facets.to_lcp(problem, self.vertices)

    def operator(self, problem: RollingFrictionContact) -> ContactOperator:
        """Return M of the LCP, never assembled."""
        self.require(problem)
        return rolling_facets.operator(problem, self.vertices)

    def predict(self, problem: RollingFrictionContact) -> Size:
        return rolling_facets.congruence(self.vertices).size(problem.W)

    def lift(self, point: LCPPoint, trace: Trace) -> FCPoint:
        return rolling_facets.from_lcp(point, self.vertices)

    def push(self, point: FCPoint, trace: Trace) -> LCPPoint:
        return rolling_facets.push(point, trace, self.vertices)
