"""Frictional contact → LCP in two dimensions, where Coulomb's cone is a polyhedron ((47)-(48) with D = [1, −1]).

Source  u = Wr + q, contact law with r = (r_N, r_T).
Target  x = (r_N, β₁, β₂, λ) a contact, r_T = β₁ − β₂:
        0 ≤ r_N ⟂ u_N ≥ 0,  0 ≤ β ⟂ λ + (u_T, −u_T) ≥ 0,  0 ≤ λ ⟂ μ r_N − β₁ − β₂ ≥ 0.
Lift    r = (r_N, β₁ − β₂).        Push  β = (max(r_T, 0), max(−r_T, 0)) within μ r_N,  λ = |u_T|.
Kind    equivalent. Siconos' smaller form, three rows a contact, is not copositive where this one is, so Lemke's
        method may end on a ray there.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions.base import conversions
from cpbench.conversions.facets import INTERVAL, PolygonEdge
from cpbench.formulations.base import Kind
from cpbench.formulations.fc import FrictionContact
from cpbench.foundation.matrices import Dense


@conversions.register("fc-lcp-2d")
@dataclass(frozen=True)
class FCtoLCP2D(PolygonEdge):
    """Plane contact, exactly. Trace: `W`, `q`, `mu`, for the multipliers of `push`."""

    name = "fc-lcp-2d"
    source = "fc"
    equation = "(47)-(48)"
    kind = Kind.EQUIVALENT
    cost = 2.0

    @property
    def vertices(self) -> Dense:
        """[1, −1]."""
        return INTERVAL

    def obstacle(self, problem: FrictionContact) -> str | None:
        if problem.dimension == 2:
            return None
        return (
            f"the problem is {problem.dimension}-dimensional, where the cone has no facets; "
            "use fc-lcp-inner or fc-lcp-outer, which approximate it"
        )
