"""Global → local rolling frictional contact: the Delassus operator (P_LM → P_L).

Source  Mv = Hr + Gλ + f,  Gᵀv + b = 0,  u = Hᵀv + w, rolling contact law;  K = [[M, −G], [Gᵀ, 0]] nonsingular.
Target  u = Wr + q,  W = [Hᵀ 0]K⁻¹[H; 0],  q = w + [Hᵀ 0]K⁻¹(f, −b), the same law, the same r.
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
from cpbench.formulations.global_contact import GFCPoint
from cpbench.formulations.grfc import GlobalRollingFrictionContact
from cpbench.formulations.rfc import RollingFrictionContact


@conversions.register("grfc-rfc")
@dataclass(frozen=True)
class GRFCtoRFC(Conversion):
    """Eliminate the velocities of the bodies and the joint reactions. Trace: `factor` (K), `H`, `f`, `b`."""

    name = "grfc-rfc"
    source = "grfc"
    target = "rfc"
    equation = "P_LM → P_L"
    kind = Kind.ONE_WAY
    best_kind = Kind.EQUIVALENT
    cost = 1.0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, GlobalRollingFrictionContact)
        return condensation.kind(problem)

    def reservation(self, problem: GlobalRollingFrictionContact) -> str:
        return condensation.reservation(problem)

    def obstacle(self, problem: GlobalRollingFrictionContact) -> str | None:
        return condensation.obstacle(problem)

    def predict(self, problem: GlobalRollingFrictionContact) -> Size:
        return condensation.size(problem)

    def apply(self, problem: GlobalRollingFrictionContact) -> tuple[RollingFrictionContact, Trace]:
        self.require(problem)
        W, q, trace = condensation.condense(problem)
        local = RollingFrictionContact(W=W, q=q, mu=problem.mu, mu_r=problem.mu_r, dimension=problem.dimension)
        return local, trace

    def lift(self, point: FCPoint, trace: Trace) -> GFCPoint:
        return condensation.lift(point, trace)

    def push(self, point: GFCPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=point.r)
