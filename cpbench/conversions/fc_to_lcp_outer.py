"""Frictional contact → LCP by a circumscribed polygon, outer facets given by their vertices ((42)-(48)).

Source  u = Wr + q, Coulomb's law with the disk of radius μ r_N.
Target  that of fc-lcp-inner with the vertices d_i of the polygon whose sides touch the circle at angle + 2πi/ν:
        d_i at angle + (2i + 1)π/ν, of length 1/cos(π/ν).
Lift    r = (r_N, Dβ).        Push  as fc-lcp-inner.
Kind    approximate: the same solutions r as fc-mlcp-outer, without W_TT nonsingular; radius too large by up to
        1/cos(π/ν) − 1, sliding direction off by up to 180°/ν.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from cpbench.conversions import facets as polygon
from cpbench.conversions.base import conversions
from cpbench.conversions.facets import PolygonEdge
from cpbench.formulations.base import Kind
from cpbench.formulations.fc import FrictionContact
from cpbench.foundation.matrices import Dense


@conversions.register("fc-lcp-outer")
@dataclass(frozen=True)
class FCtoLCPOuter(PolygonEdge):
    """`facets` sides, the first touching the circle at `angle` [rad]. Trace: `W`, `q`, `mu`, for `push`."""

    name = "fc-lcp-outer"
    source = "fc"
    equation = "(42)-(48)"
    kind = Kind.APPROXIMATE
    cost = 4.0

    facets: int = 8
    angle: float = 0.0

    @property
    def vertices(self) -> Dense:
        """d_i as columns, shape (2, ν)."""
        half = math.pi / self.facets
        return polygon.directions(self.facets, self.angle + half) / math.cos(half)

    def obstacle(self, problem: FrictionContact) -> str | None:
        return polygon.obstacle(problem, self.facets, self.angle)
