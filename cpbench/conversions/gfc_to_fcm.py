"""Global → local mixed frictional contact: velocities eliminated, joint reactions kept (FCLIB local with V, R, s).

Source  Mv = Hr + Gλ + f,  Gᵀv + b = 0,  u = Hᵀv + w, contact law;  M symmetric and nonsingular.
Target  u = Wr + Vλ + q,  Vᵀr + Rλ + s = 0, the same law:  W = HᵀM⁻¹H,  V = HᵀM⁻¹G,  R = GᵀM⁻¹G,
        q = HᵀM⁻¹f + w,  s = GᵀM⁻¹f + b.
Lift    v = M⁻¹(Hr + Gλ + f).        Push  r, λ.
Kind    equivalent while eps cond(M) <= 1e-8 (`elimination.LOSSLESS`), one-way beyond: the target may then lack
        solutions of the source, and what is lifted is as exact as rounding leaves it. Refused from cond(M) = 1e13 on.
        M must be symmetric because the schema has one V for both rows.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import condensation, elimination
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.fcm import FCMPoint, MixedFrictionContact
from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.formulations.global_contact import GFCPoint
from cpbench.foundation import matrices


@conversions.register("gfc-fcm")
@dataclass(frozen=True)
class GFCtoFCM(Conversion):
    """Eliminate the velocities of the bodies. Trace: `factor` (M), `H`, `G`, `f`."""

    name = "gfc-fcm"
    source = "gfc"
    target = "fcm"
    equation = "P_LM → P_L"
    kind = Kind.ONE_WAY
    best_kind = Kind.EQUIVALENT
    cost = 2.0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, GlobalFrictionContact)
        return elimination.kind(problem.factorization.rcond)

    def reservation(self, problem: GlobalFrictionContact) -> str:
        return elimination.reservation(problem.factorization.rcond, "the mass matrix M")

    def obstacle(self, problem: GlobalFrictionContact) -> str | None:
        if not matrices.is_symmetric(problem.M):
            asymmetry = matrices.asymmetry(problem.M)
            return f"M is not symmetric, asymmetry = {asymmetry:.1e}: Vᵀ would not be Gᵀ M⁻¹ H; use gfc-fc"
        return condensation.singular_mass(problem)

    def apply(self, problem: GlobalFrictionContact) -> tuple[MixedFrictionContact, Trace]:
        self.require(problem)
        factor, H, G = problem.factorization, problem.H, problem.G
        free = factor.solve(problem.f)
        target = MixedFrictionContact(
            W=elimination.congruence(H, factor),
            V=elimination.product(matrices.transpose(H), factor, G),
            R=elimination.congruence(G, factor),
            q=H.T @ free + problem.w,
            s=G.T @ free + problem.b,
            mu=problem.mu,
            dimension=problem.dimension,
        )
        return target, {"factor": factor, "H": H, "G": G, "f": problem.f}

    def lift(self, point: FCMPoint, trace: Trace) -> GFCPoint:
        force = trace["H"] @ point.r + trace["G"] @ point.lam + trace["f"]
        return GFCPoint(v=trace["factor"].solve(force), r=point.r, lam=point.lam)

    def push(self, point: GFCPoint, trace: Trace) -> FCMPoint:
        return FCMPoint(r=point.r, lam=point.lam)
