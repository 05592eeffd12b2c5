"""LCP → QP for any M: minimise zᵀw over the feasible set (equation (15)).

Source  0 ≤ z ⟂ w = Mz + q ≥ 0.
Target  min ½zᵀ(M + Mᵀ)z + qᵀz = zᵀw  subject to  Mz ≥ −q,  z ≥ 0 (as bounds, multiplier ν).
        z solves the LCP if and only if the objective is 0; then λ = z and ν = w are multipliers.
Lift    z.        Push  z, λ = z, ν = Mz + q.
Kind    equivalent when M + Mᵀ is positive semidefinite (feasible implies solvable). Otherwise necessary: a solution
        of the LCP is a global minimiser, but a stationary point need not be one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions.base import Conversion, conversions
from cpbench.conversions.convexity import indefinite
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.formulations.qp import QP, QPPoint
from cpbench.foundation import matrices


@conversions.register("lcp-qp-nonsymmetric")
@dataclass(frozen=True)
class LCPtoQPNonsymmetric(Conversion):
    """The LCP as minimal complementarity over its feasible set. Trace: `M`, `q`, for the multipliers of `push`."""

    name = "lcp-qp-nonsymmetric"
    source = "lcp"
    target = "qp"
    equation = "(15)"
    kind = Kind.NECESSARY
    best_kind = Kind.EQUIVALENT
    cost = 3.0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, LCP)
        return self.best_kind if problem.monotone else self.kind

    def reservation(self, problem: LCP) -> str:
        return indefinite(problem.M, "M")

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for ε²: a gap δ = Σ zᵢwᵢ may be one product √δ·√δ, whose natural residual min(zᵢ, wᵢ) is √δ."""
        return min(tolerance, tolerance * tolerance)

    def apply(self, problem: LCP) -> tuple[QP, Trace]:
        M, q = problem.M, problem.q
        target = QP.build(M + matrices.transpose(M), q, A=M, b=-q, lb=np.zeros(q.size))
        return target, {"M": M, "q": q}

    def lift(self, point: QPPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.z)

    def push(self, point: LCPPoint, trace: Trace) -> QPPoint:
        w = trace["M"] @ point.z + trace["q"]
        return QPPoint(z=point.z, lam=point.z, mu=np.zeros(0), nu=w)
