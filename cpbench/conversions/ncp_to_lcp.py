"""NCP → LCP, F affine (equations (19) and (13)).

Source  0 ≤ z ⟂ F(z) ≥ 0,  F(z) = Mz + q.
Target  0 ≤ z ⟂ Mz + q ≥ 0.
Lift    z.        Push  z.
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import maps
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.formulations.ncp import NCP, NCPPoint


@conversions.register("ncp-lcp")
@dataclass(frozen=True)
class NCPtoLCP(Conversion):
    """An NCP without nonlinear terms, for solvers of linear ones. Trace: empty."""

    name = "ncp-lcp"
    source = "ncp"
    target = "lcp"
    equation = "(19) → (13)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: NCP) -> str | None:
        return maps.curved(problem.F, "F")

    def apply(self, problem: NCP) -> tuple[LCP, Trace]:
        self.require(problem)
        F = problem.F.compiled
        return LCP(M=F.M, q=F.q), {}

    def lift(self, point: LCPPoint, trace: Trace) -> NCPPoint:
        return NCPPoint(z=point.z)

    def push(self, point: NCPPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.z)
