"""Conversions of soclcp."""

from __future__ import annotations

from cpbench.conversions import nonlinear
from cpbench.conversions.base import SameUnknowns, edge
from cpbench.conversions.qualification import WhereConvex
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.conic import CP, SOCLCP, ConeQP, ConeQPPoint, SOCLCPPoint, cone_fields
from cpbench.foundation import matrices


@edge("soclcp-coneqp", equation="(17)", kind=Kind.ONE_WAY, cost=1.0)
class SOCLCPtoConeQP(WhereConvex):
    """Cone LCP → cone QP, M symmetric.

    Source  K ∋ x ⟂ Mx + q ∈ K*.
    Target  min ½xᵀMx + qᵀx over x ∈ K; its multiplier is y = Mx + q.
    Lift    x.        Push  x, y = Mx + q.
    Kind    equivalent when M is positive semidefinite, otherwise one-way, as avi-qp: a verdict accepts the stationary
            points, flagged, which are the solutions; the minima are some of them, or none (M = −1, q = 1 over ℝ₊).

    Trace: `M`, `q`, for the multiplier of `push`.
    """

    matrix = "M"

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


@edge("soclcp-cp", equation="(17)", kind=Kind.EQUIVALENT, cost=4.0)
class SOCLCPtoCP(SameUnknowns):
    """Cone LCP → cone complementarity problem, the affine one (equation (17)).

    Source  K ∋ x ⟂ Mx + q ∈ K*.
    Target  K ∋ x ⟂ F(x) ∈ K*,  F(x) = Mx + q.
    Lift    x.        Push  x.
    Kind    equivalent.
    """

    def obstacle(self, problem: SOCLCP) -> str | None:
        return nonlinear.too_large(problem.M)

    def apply(self, problem: SOCLCP) -> tuple[CP, Trace]:
        self.require(problem)
        F = nonlinear.affine(problem.M, problem.q)
        return CP(F=F, **cone_fields(problem.K)), {}  # pyright: ignore[reportArgumentType]
