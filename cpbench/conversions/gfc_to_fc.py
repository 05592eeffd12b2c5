"""Global → local frictional contact: the Delassus operator (P_LM → P_L).

Source  Mv = Hr + Gλ + f,  Gᵀv + b = 0,  u = Hᵀv + w, contact law on (u, r);  K = [[M, −G], [Gᵀ, 0]] nonsingular.
Target  u = Wr + q,  W = [Hᵀ 0]K⁻¹[H; 0],  q = w + [Hᵀ 0]K⁻¹(f, −b), the same law, the same r. Without joints
        W = HᵀM⁻¹H,  q = HᵀM⁻¹f + w.
Lift    (v, λ) = K⁻¹(Hr + f, −b).        Push  r.
Kind    equivalent while eps cond(K) <= 1e-8 (`elimination.LOSSLESS`), one-way beyond: the target may then lack
        solutions of the source, and what is lifted is as exact as rounding leaves it. Refused from cond(K) = 1e13 on.
        M may be nonsymmetric, or singular by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import condensation
from cpbench.conversions.base import Conversion, Size, conversions
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.formulations.global_contact import GFCPoint


@conversions.register("gfc-fc")
@dataclass(frozen=True)
class GFCtoFC(Conversion):
    """Eliminate the velocities of the bodies and the joint reactions. Trace: `factor` (K), `H`, `f`, `b`."""

    name = "gfc-fc"
    source = "gfc"
    target = "fc"
    equation = "P_LM → P_L"
    kind = Kind.ONE_WAY
    best_kind = Kind.EQUIVALENT
    cost = 1.0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, GlobalFrictionContact)
        return condensation.kind(problem)

    def reservation(self, problem: GlobalFrictionContact) -> str:
        return condensation.reservation(problem)

    def obstacle(self, problem: GlobalFrictionContact) -> str | None:
        return condensation.obstacle(problem)

    def predict(self, problem: GlobalFrictionContact) -> Size:
        return condensation.size(problem)

    def apply(self, problem: GlobalFrictionContact) -> tuple[FrictionContact, Trace]:
        self.require(problem)
        W, q, trace = condensation.condense(problem)
        return FrictionContact(W=W, q=q, mu=problem.mu, dimension=problem.dimension), trace

    def lift(self, point: FCPoint, trace: Trace) -> GFCPoint:
        return condensation.lift(point, trace)

    def push(self, point: GFCPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=point.r)
