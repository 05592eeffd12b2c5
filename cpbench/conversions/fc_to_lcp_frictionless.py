"""Frictionless contact → LCP of the normal reactions.

Source  u = Wr + q,  μ = 0: r_T = 0,  0 ≤ r_N ⟂ u_N ≥ 0.
Target  M = W_NN,  q = q_N,  z = r_N.
Lift    r = (r_N, 0).        Push  r_N.
Kind    equivalent, in two and three dimensions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.foundation.plurals import counted


@conversions.register("fc-lcp-frictionless")
@dataclass(frozen=True)
class FCtoLCPFrictionless(Conversion):
    """Contact without friction. Trace: `d` (rows of a contact)."""

    name = "fc-lcp-frictionless"
    source = "fc"
    target = "lcp"
    equation = "(40), local"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: FrictionContact) -> str | None:
        rubbing = np.flatnonzero(problem.mu)
        if not rubbing.size:
            return None
        c = int(rubbing[0])
        return f"friction at {counted(rubbing.size, 'contact')}, the first is {c} with μ = {problem.mu[c]:g}"

    def apply(self, problem: FrictionContact) -> tuple[LCP, Trace]:
        self.require(problem)
        d = problem.dimension
        return LCP(M=problem.W[::d, ::d], q=problem.q[::d]), {"d": d}

    def lift(self, point: LCPPoint, trace: Trace) -> FCPoint:
        r = np.zeros(point.z.size * trace["d"])
        r[:: trace["d"]] = point.z
        return FCPoint(r=r)

    def push(self, point: FCPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.r[:: trace["d"]])
