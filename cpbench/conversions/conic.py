"""Conversions of problems over a product of cones: cp, soclcp and coneqp."""

from __future__ import annotations

import numpy as np

from cpbench.conversions import maps, qualification
from cpbench.conversions.base import Conversion, SameUnknowns, edge
from cpbench.conversions.qualification import WhereConvex, indefinite
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.conic import CP, SOCLCP, ConeQP, ConeQPPoint, SOCLCPPoint, cone_fields
from cpbench.formulations.variational import VI
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone, ProductCone


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
        return maps.curved(problem.F, "F")

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
        return maps.too_large(problem.M)

    def apply(self, problem: SOCLCP) -> tuple[CP, Trace]:
        self.require(problem)
        F = maps.affine(problem.M, problem.q)
        return CP(F=F, **cone_fields(problem.K)), {}  # pyright: ignore[reportArgumentType]


@edge("coneqp-soclcp", equation="(3) over a cone", kind=Kind.NECESSARY, cost=1.0)
class ConeQPtoSOCLCP(Conversion):
    """Cone QP → cone LCP by its optimality conditions.

    Source  min ½xᵀQx + pᵀx  subject to  Ax + b ∈ K, K a product of cones.
    Target  x ∈ K ⟂ Qx + p ∈ K* where A = I and b = 0; otherwise (x, y) ∈ ℝⁿ × K*, the free x complementary to {0}:
            Qx + p − Aᵀy = 0,  K* ∋ y ⟂ Ax + b ∈ K.
    Lift    x, y (y = Qx + p in the first case).        Push  the same, backwards.
    Kind    with Q positive semidefinite equivalent where a constraint qualification is known (`qualification.of_cone`),
            one-way without: a minimum may have no multiplier then (min y subject to (x, x, y) in a second-order cone).
            With another Q necessary (stationary points), and refused where no qualification is known. A = I, b = 0 need
            none.

    Trace: `n` (size of x), `plain` (A = I, b = 0), `Q`, `p`.
    """

    best_kind = Kind.EQUIVALENT
    between = (Kind.ONE_WAY,)

    def exactness(self, problem: ConeQP) -> Kind:
        if not problem.convex:
            return self.kind
        return Kind.ONE_WAY if qualification.of_cone(problem) else self.best_kind

    def reservation(self, problem: ConeQP) -> str:
        if not problem.convex:
            return indefinite(problem.Q, "Q")
        return f"no constraint qualification is known: {qualification.of_cone(problem)}"

    def obstacle(self, problem: ConeQP) -> str | None:
        if not problem.K.conical:
            count = int((problem.cone_kind == Cone.CYLINDER).sum())
            return f"{count} factors of K are cylinders ℝ₊ × disk, which are no cones; solve the cone QP itself"
        why = "" if problem.convex else qualification.of_cone(problem)
        if not why:
            return None
        return (
            f"{indefinite(problem.Q, 'Q')}, and no constraint qualification is known: {why}; a minimum may have no "
            "multiplier, and a point with one may be no minimum: solve the cone QP itself"
        )

    def apply(self, problem: ConeQP) -> tuple[SOCLCP, Trace]:
        self.require(problem)
        n, K = problem.p.size, problem.K
        plain = problem.plain
        trace = {"n": n, "plain": int(plain), "Q": problem.Q, "p": problem.p}
        if plain:
            return SOCLCP(M=problem.Q, q=problem.p, **cone_fields(K)), trace  # pyright: ignore[reportArgumentType]
        dual, free = K.dual(), ProductCone.of((Cone.FREE, 1, n))
        both = {name: np.concatenate([part, cone_fields(dual)[name]]) for name, part in cone_fields(free).items()}
        corner = matrices.zeros(K.rows, K.rows, problem.Q)
        M = matrices.block([[problem.Q, -matrices.transpose(problem.A)], [problem.A, corner]])
        return SOCLCP(M=M, q=np.concatenate([problem.p, problem.b]), **both), trace  # pyright: ignore[reportArgumentType]

    def lift(self, point: SOCLCPPoint, trace: Trace) -> ConeQPPoint:
        if trace["plain"]:
            return ConeQPPoint(x=point.x, y=trace["Q"] @ point.x + trace["p"])
        return ConeQPPoint(x=point.x[: trace["n"]], y=point.x[trace["n"] :])

    def push(self, point: ConeQPPoint, trace: Trace) -> SOCLCPPoint:
        return SOCLCPPoint(x=point.x if trace["plain"] else np.concatenate([point.x, point.y]))
