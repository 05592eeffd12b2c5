"""LCP → MLCP without free unknowns (equations (13) and (14)).

Source  0 ≤ z ⟂ Mz + q ≥ 0.
Target  B = M,  b = q,  v = z;  A, C, D and a are empty (n = 0).
Lift    z = v.        Push  v = z, u empty.
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.formulations.mlcp import MLCP, MLCPPoint
from cpbench.foundation import matrices


@conversions.register("lcp-mlcp")
@dataclass(frozen=True)
class LCPtoMLCP(Conversion):
    """An LCP read as a mixed one. Trace: empty."""

    name = "lcp-mlcp"
    source = "lcp"
    target = "mlcp"
    equation = "(14)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def apply(self, problem: LCP) -> tuple[MLCP, Trace]:
        M, m = problem.M, problem.q.size
        target = MLCP(
            A=matrices.zeros(0, 0, M),
            B=M,
            C=matrices.zeros(0, m, M),
            D=matrices.zeros(m, 0, M),
            a=np.zeros(0),
            b=problem.q,
        )
        return target, {}

    def lift(self, point: MLCPPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.v)

    def push(self, point: LCPPoint, trace: Trace) -> MLCPPoint:
        return MLCPPoint(u=np.zeros(0), v=point.z)
