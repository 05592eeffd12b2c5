"""Rolling frictional contact → LCP in the plane, where the rolling cone is a polyhedron.

Source  u = Wr + q, rolling contact law with r = (r_N, r_T, m).
Target  x = (r_N, β₁, β₂, λ, γ₁, γ₂, κ) a contact, r_T = β₁ − β₂,  m = γ₁ − γ₂:
        0 ≤ r_N ⟂ u_N ≥ 0,  0 ≤ β ⟂ λ + (u_T, −u_T) ≥ 0,  0 ≤ λ ⟂ μ r_N − β₁ − β₂ ≥ 0,
                            0 ≤ γ ⟂ κ + (ω, −ω) ≥ 0,      0 ≤ κ ⟂ μ_r r_N − γ₁ − γ₂ ≥ 0.
Lift    r = (r_N, β₁ − β₂, γ₁ − γ₂).        Push  positive and negative parts,  λ = |u_T|,  κ = |ω|.
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions import rolling_facets
from cpbench.conversions.base import Conversion, Size, conversions
from cpbench.conversions.operators import ContactOperator
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.formulations.rfc import RollingFrictionContact

_DIRECTIONS = np.array([[1.0, -1.0]])


@conversions.register("rfc-lcp-2d")
@dataclass(frozen=True)
class RFCtoLCP2D(Conversion):
    """Rolling in the plane, exactly. Trace: `W`, `q`, `mu`, `mu_r`, for the multipliers of `push`."""

    name = "rfc-lcp-2d"
    source = "rfc"
    target = "lcp"
    equation = "(47)-(48), rolling"
    kind = Kind.EQUIVALENT
    cost = 2.0

    def obstacle(self, problem: RollingFrictionContact) -> str | None:
        if problem.dimension == 3:
            return None
        return f"a contact has {problem.dimension} rows, where the cone has no facets; use rfc-lcp-facets"

    def apply(self, problem: RollingFrictionContact) -> tuple[LCP, Trace]:
        self.require(problem)
        return rolling_facets.to_lcp(problem, _DIRECTIONS)

    def operator(self, problem: RollingFrictionContact) -> ContactOperator:
        """Return M of the LCP, never assembled."""
        self.require(problem)
        return rolling_facets.operator(problem, _DIRECTIONS)

    def predict(self, problem: RollingFrictionContact) -> Size:
        return rolling_facets.congruence(_DIRECTIONS).size(problem.W)

    def lift(self, point: LCPPoint, trace: Trace) -> FCPoint:
        return rolling_facets.from_lcp(point, _DIRECTIONS)

    def push(self, point: FCPoint, trace: Trace) -> LCPPoint:
        return rolling_facets.push(point, trace, _DIRECTIONS)
