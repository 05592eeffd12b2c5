"""NCP → MiCP, all of it complementary (equations (19) to (21)).

Source  0 ≤ z ⟂ F(z) ≥ 0.
Target  the MiCP of F with lb = 0, ub = ∞.
Lift    z.        Push  z.
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.micp import MiCP, MiCPPoint
from cpbench.formulations.ncp import NCP, NCPPoint


@conversions.register("ncp-micp")
@dataclass(frozen=True)
class NCPtoMiCP(Conversion):
    """An NCP as a mixed one without free unknowns. Trace: empty."""

    name = "ncp-micp"
    source = "ncp"
    target = "micp"
    equation = "(19) → (21)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def apply(self, problem: NCP) -> tuple[MiCP, Trace]:
        n = problem.start.size
        return MiCP(F=problem.F, lb=np.zeros(n), ub=np.full(n, np.inf), start=problem.start), {}

    def lift(self, point: MiCPPoint, trace: Trace) -> NCPPoint:
        return NCPPoint(z=point.z)

    def push(self, point: NCPPoint, trace: Trace) -> MiCPPoint:
        return MiCPPoint(z=point.z)
