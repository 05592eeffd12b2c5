"""Relay → AVI: the box is a polyhedron.

Source  −(Mz + q) ∈ N_[lb,ub](z).
Target  the same, with no rows beside the bounds.
Lift    z.        Push  z.
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.avi import AVI, AVIPoint
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.lcp import LCPPoint
from cpbench.formulations.relay import Relay


@conversions.register("relay-avi")
@dataclass(frozen=True)
class RelayToAVI(Conversion):
    """A relay read as a variational inequality. Trace: empty."""

    name = "relay-avi"
    source = "relay"
    target = "avi"
    equation = "(22)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def apply(self, problem: Relay) -> tuple[AVI, Trace]:
        return AVI(M=problem.M, q=problem.q, lb=problem.lb, ub=problem.ub), {}

    def lift(self, point: AVIPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.z)

    def push(self, point: LCPPoint, trace: Trace) -> AVIPoint:
        return AVIPoint(z=point.z)
