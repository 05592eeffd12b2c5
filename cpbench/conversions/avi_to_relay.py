"""AVI over a finite box → relay.

Source  −(Mz + q) ∈ N_[lb,ub](z), bounds finite, no rows beside.
Target  the same.
Lift    z.        Push  z.
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.avi import AVI, AVIPoint
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.lcp import LCPPoint
from cpbench.formulations.relay import Relay


@conversions.register("avi-relay")
@dataclass(frozen=True)
class AVItoRelay(Conversion):
    """A variational inequality over a finite box. Trace: empty."""

    name = "avi-relay"
    source = "avi"
    target = "relay"
    equation = "(22)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: AVI) -> str | None:
        if not problem.only_box:
            rows = problem.b.size + problem.d.size
            return f"the set has {rows} rows beside its bounds, a relay has a box; use avi-mlcp"
        infinite = int(np.isinf(problem.lb).sum() + np.isinf(problem.ub).sum())
        if infinite:
            return f"{infinite} bounds are infinite, those of a relay are finite; use avi-lcp-bounds or avi-mlcp"
        return None

    def apply(self, problem: AVI) -> tuple[Relay, Trace]:
        self.require(problem)
        return Relay(M=problem.M, q=problem.q, lb=problem.lb, ub=problem.ub), {}

    def lift(self, point: LCPPoint, trace: Trace) -> AVIPoint:
        return AVIPoint(z=point.z)

    def push(self, point: AVIPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.z)
