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

from cpbench.conversions.base import conversions
from cpbench.conversions.facets import INTERVAL, PolygonEdge
from cpbench.formulations.base import Kind
from cpbench.formulations.rfc import RollingFrictionContact
from cpbench.foundation.matrices import Dense


@conversions.register("rfc-lcp-2d")
@dataclass(frozen=True)
class RFCtoLCP2D(PolygonEdge):
    """Rolling in the plane, exactly. Trace: `W`, `q`, `mu`, `mu_r`, for the multipliers of `push`."""

    name = "rfc-lcp-2d"
    source = "rfc"
    equation = "(47)-(48), rolling"
    kind = Kind.EQUIVALENT
    cost = 2.0

    @property
    def vertices(self) -> Dense:
        """[1, −1]."""
        return INTERVAL

    def obstacle(self, problem: RollingFrictionContact) -> str | None:
        if problem.dimension == 3:
            return None
        return f"a contact has {problem.dimension} rows, where the cone has no facets; use rfc-lcp-facets"
