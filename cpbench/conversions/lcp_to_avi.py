"""LCP → AVI over the orthant (equations (13) and (22)).

Source  0 ≤ z ⟂ Mz + q ≥ 0.
Target  −(Mz + q) ∈ N_X(z),  X = {z ≥ 0}.
Lift    z.        Push  z.
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.avi import AVI, AVIPoint
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.lcp import LCP, LCPPoint


@conversions.register("lcp-avi")
@dataclass(frozen=True)
class LCPtoAVI(Conversion):
    """An LCP read as a variational inequality. Trace: empty."""

    name = "lcp-avi"
    source = "lcp"
    target = "avi"
    equation = "(13) → (22)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def apply(self, problem: LCP) -> tuple[AVI, Trace]:
        return AVI(M=problem.M, q=problem.q, lb=np.zeros(problem.q.size)), {}

    def lift(self, point: AVIPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.z)

    def push(self, point: LCPPoint, trace: Trace) -> AVIPoint:
        return AVIPoint(z=point.z)
