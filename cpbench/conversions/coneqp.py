"""Conversions of coneqp."""

from __future__ import annotations

import numpy as np

from cpbench.conversions import qualification
from cpbench.conversions.base import Conversion, edge
from cpbench.conversions.qualification import indefinite
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.conic import SOCLCP, ConeQP, ConeQPPoint, SOCLCPPoint, cone_fields
from cpbench.foundation import matrices
from cpbench.foundation.product_cones import Cone, ProductCone


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
