"""LCP → NCP, the affine one (equations (13) and (19)).

Source  0 ≤ z ⟂ Mz + q ≥ 0.
Target  0 ≤ z ⟂ F(z) ≥ 0,  F(z) = Mz + q.
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


@conversions.register("lcp-ncp")
@dataclass(frozen=True)
class LCPtoNCP(Conversion):
    """An LCP for solvers of nonlinear ones. Trace: empty."""

    name = "lcp-ncp"
    source = "lcp"
    target = "ncp"
    equation = "(13) → (19)"
    kind = Kind.EQUIVALENT
    cost = 4.0

    def obstacle(self, problem: LCP) -> str | None:
        return maps.too_large(problem.M)

    def apply(self, problem: LCP) -> tuple[NCP, Trace]:
        self.require(problem)
        return NCP(F=maps.affine(problem.M, problem.q)), {}

    def lift(self, point: NCPPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.z)

    def push(self, point: LCPPoint, trace: Trace) -> NCPPoint:
        return NCPPoint(z=point.z)
