"""Cone LCP → cone QP, M symmetric.

Source  K ∋ x ⟂ Mx + q ∈ K*.
Target  min ½xᵀMx + qᵀx over x ∈ K; its multiplier is y = Mx + q.
Lift    x.        Push  x, y = Mx + q.
Kind    equivalent when M is positive semidefinite, otherwise one-way, as avi-qp: a verdict accepts the stationary
        points, flagged, which are the solutions; the minima are some of them, or none (M = −1, q = 1 over ℝ₊).
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions.base import Conversion, conversions
from cpbench.conversions.convexity import indefinite
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.coneqp import ConeQP, ConeQPPoint
from cpbench.formulations.soclcp import SOCLCP, SOCLCPPoint
from cpbench.foundation import matrices


@conversions.register("soclcp-coneqp")
@dataclass(frozen=True)
class SOCLCPtoConeQP(Conversion):
    """A symmetric cone LCP as the conditions of a minimum. Trace: `M`, `q`, for the multiplier of `push`."""

    name = "soclcp-coneqp"
    source = "soclcp"
    target = "coneqp"
    equation = "(17)"
    kind = Kind.ONE_WAY
    best_kind = Kind.EQUIVALENT
    cost = 1.0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, SOCLCP)
        return self.best_kind if problem.monotone else self.kind

    def reservation(self, problem: SOCLCP) -> str:
        return indefinite(problem.M, "M")

    def obstacle(self, problem: SOCLCP) -> str | None:
        if problem.symmetric:
            return None
        asymmetry = matrices.asymmetry(problem.M)
        return f"M is not symmetric, asymmetry = {asymmetry:.1e}: it is no gradient; solve the cone LCP itself"

    def apply(self, problem: SOCLCP) -> tuple[ConeQP, Trace]:
        self.require(problem)
        return ConeQP.over(problem.M, problem.q, problem.K), {"M": problem.M, "q": problem.q}

    def lift(self, point: ConeQPPoint, trace: Trace) -> SOCLCPPoint:
        return SOCLCPPoint(x=point.x)

    def push(self, point: SOCLCPPoint, trace: Trace) -> ConeQPPoint:
        return ConeQPPoint(x=point.x, y=trace["M"] @ point.x + trace["q"])
