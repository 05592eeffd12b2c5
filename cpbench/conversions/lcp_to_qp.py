"""LCP → QP, M symmetric positive semidefinite (equations (1) and (13)).

Source  0 ≤ z ⟂ w = Mz + q ≥ 0.
Target  min ½zᵀMz + qᵀz over z ≥ 0; stationarity Mz + q − ν = 0, with 0 ≤ z ⟂ ν ≥ 0: ν is w.
        z ≥ 0 is the QP's box (lb = 0), which every QP solver treats better than rows A = I, b = 0.
Lift    z.        Push  z, ν = Mz + q.
Kind    equivalent: the QP is convex, so its minimisers are its stationary points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.formulations.qp import QP, QPPoint
from cpbench.foundation import matrices


@conversions.register("lcp-qp")
@dataclass(frozen=True)
class LCPtoQP(Conversion):
    """The symmetric LCP as a bound-constrained QP. Trace: `M`, `q`, for the multipliers of `push`."""

    name = "lcp-qp"
    source = "lcp"
    target = "qp"
    equation = "(1)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: LCP) -> str | None:
        if not problem.symmetric:
            return f"M is not symmetric, asymmetry = {matrices.asymmetry(problem.M):.1e}; use lcp-qp-nonsymmetric"
        if not problem.monotone:
            least = matrices.least_eigenvalue(problem.M)
            return (
                f"M is not positive semidefinite, least eigenvalue at unit diagonal {least:.1e} or less, so a "
                "minimiser need not exist; use lcp-mlcp, or lcp-qp-nonsymmetric, which is necessary only"
            )
        return None

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for three digits more: a duality gap δ may leave a natural residual min(zᵢ, wᵢ) between δ and √δ.

        A guarantee would take ε², which methods of first order do not reach; three digits cost no measurable time.
        """
        return 1e-3 * tolerance

    def apply(self, problem: LCP) -> tuple[QP, Trace]:
        self.require(problem)
        target = QP.build(problem.M, problem.q, lb=np.zeros(problem.q.size))
        return target, {"M": problem.M, "q": problem.q}

    def lift(self, point: QPPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.z)

    def push(self, point: LCPPoint, trace: Trace) -> QPPoint:
        none = np.zeros(0)
        return QPPoint(z=point.z, lam=none, mu=none, nu=trace["M"] @ point.z + trace["q"])
