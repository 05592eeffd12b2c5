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

import numpy as np

from cpbench.conversions import facets
from cpbench.conversions.base import Conversion, Size, conversions
from cpbench.conversions.operators import ContactOperator
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.lcp import LCP, LCPPoint

_DIRECTIONS = np.array([[1.0, -1.0]])


@conversions.register("fc-lcp-2d")
@dataclass(frozen=True)
class FCtoLCP2D(Conversion):
    """Plane contact, exactly. Trace: `W`, `q`, `mu`, for the multipliers of `push`."""

    name = "fc-lcp-2d"
    source = "fc"
    target = "lcp"
    equation = "(47)-(48)"
    kind = Kind.EQUIVALENT
    cost = 2.0

    def obstacle(self, problem: FrictionContact) -> str | None:
        if problem.dimension == 2:
            return None
        return (
            f"the problem is {problem.dimension}-dimensional, where the cone has no facets; "
            "use fc-lcp-inner or fc-lcp-outer, which approximate it"
        )

    def apply(self, problem: FrictionContact) -> tuple[LCP, Trace]:
        self.require(problem)
        return facets.to_lcp(problem, _DIRECTIONS)

    def operator(self, problem: FrictionContact) -> ContactOperator:
        """Return M of the LCP, never assembled."""
        self.require(problem)
        return facets.operator(problem, _DIRECTIONS)

    def predict(self, problem: FrictionContact) -> Size:
        return facets.predict(problem, _DIRECTIONS)

    def lift(self, point: LCPPoint, trace: Trace) -> FCPoint:
        return facets.from_lcp(point, _DIRECTIONS)

    def push(self, point: FCPoint, trace: Trace) -> LCPPoint:
        normal, tangential, velocity = facets.split(point, trace, 2)
        bound = (trace["mu"] * normal)[:, None]
        beta = np.minimum(np.maximum(tangential @ _DIRECTIONS, 0.0), bound)
        return facets.into_lcp(beta, _DIRECTIONS, normal, velocity)
