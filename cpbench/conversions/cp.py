"""Conversions of cp."""

from __future__ import annotations

from cpbench.conversions import nonlinear
from cpbench.conversions.base import SameUnknowns, edge
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.conic import CP, SOCLCP, cone_fields
from cpbench.formulations.variational import VI


@edge("cp-soclcp", equation="(17)", kind=Kind.EQUIVALENT, cost=1.0)
class CPtoSOCLCP(SameUnknowns):
    """Cone complementarity problem → cone LCP, F affine and no rows (equation (17)).

    Source  K ∋ x ⟂ F(x) ∈ K*,  F(x) = Mx + q.
    Target  K ∋ x ⟂ Mx + q ∈ K*.
    Lift    x.        Push  x.
    Kind    equivalent.
    """

    def obstacle(self, problem: CP) -> str | None:
        if problem.A.shape[0]:
            return f"the cone has {problem.A.shape[0]} rows Ax ≥ 0 beside its factors; use cp-vi"
        return nonlinear.curved(problem.F, "F")

    def apply(self, problem: CP) -> tuple[SOCLCP, Trace]:
        self.require(problem)
        F = problem.F.compiled
        return SOCLCP(M=F.M, q=F.q, **cone_fields(problem.K)), {}  # pyright: ignore[reportArgumentType]


@edge("cp-vi", equation="(17) → (22)", kind=Kind.EQUIVALENT, cost=1.0)
class CPtoVI(SameUnknowns):
    """Cone complementarity problem → VI (equations (17) and (22)).

    Source  C ∋ x ⟂ F(x) ∈ C*,  C = {x ∈ K : Ax ≥ 0}.
    Target  F(z)ᵀ(y − z) ≥ 0 for all y ∈ C.
    Lift    x = z, λ.        Push  z = x, λ.
    Kind    equivalent: F(x)ᵀx = 0 and F(x)ᵀy ≥ 0 on C are the inequality for all y.
    """

    renamed = {"x": "z"}

    def apply(self, problem: CP) -> tuple[VI, Trace]:
        return VI(F=problem.F, **problem.data()), {}  # pyright: ignore[reportArgumentType]
