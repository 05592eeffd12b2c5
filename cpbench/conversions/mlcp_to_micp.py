"""MLCP → MiCP, the affine one (equations (14) and (20)).

Source  Au + Cv + a = 0,  0 ≤ v ⟂ Du + Bv + b ≥ 0.
Target  z = (u, v),  F(z) = [[A, C], [D, B]] z + (a, b),  lb = (−∞, 0),  ub = ∞.
Lift    u and v, the parts of z.        Push  z = (u, v).
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions import maps
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.micp import MiCP, MiCPPoint
from cpbench.formulations.mlcp import MLCP, MLCPPoint
from cpbench.foundation import matrices


@conversions.register("mlcp-micp")
@dataclass(frozen=True)
class MLCPtoMiCP(Conversion):
    """An MLCP for solvers of nonlinear ones. Trace: `n`, how many unknowns are free."""

    name = "mlcp-micp"
    source = "mlcp"
    target = "micp"
    equation = "(14) → (20)"
    kind = Kind.EQUIVALENT
    cost = 4.0

    def obstacle(self, problem: MLCP) -> str | None:
        return maps.too_large(problem.A, problem.B, problem.C, problem.D)

    def apply(self, problem: MLCP) -> tuple[MiCP, Trace]:
        self.require(problem)
        n, m = problem.a.size, problem.b.size
        whole = matrices.block([[problem.A, problem.C], [problem.D, problem.B]])
        F = maps.affine(whole, np.concatenate([problem.a, problem.b]))
        lb = np.concatenate([np.full(n, -np.inf), np.zeros(m)])
        return MiCP(F=F, lb=lb, ub=np.full(n + m, np.inf)), {"n": n}

    def lift(self, point: MiCPPoint, trace: Trace) -> MLCPPoint:
        return MLCPPoint(u=point.z[: trace["n"]], v=point.z[trace["n"] :])

    def push(self, point: MLCPPoint, trace: Trace) -> MiCPPoint:
        return MiCPPoint(z=np.concatenate([point.u, point.v]))
