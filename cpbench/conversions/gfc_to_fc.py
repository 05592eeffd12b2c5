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

from cpbench.conversions.base import conversions
from cpbench.conversions.condensation import Condensation, condense
from cpbench.formulations.base import Trace
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.gfc import GlobalFrictionContact


@conversions.register("gfc-fc")
@dataclass(frozen=True)
class GFCtoFC(Condensation):
    """Eliminate the velocities of the bodies and the joint reactions. Trace: `factor` (K), `H`, `f`, `b`."""

    name = "gfc-fc"
    source = "gfc"
    target = "fc"

    def apply(self, problem: GlobalFrictionContact) -> tuple[FrictionContact, Trace]:
        self.require(problem)
        W, q, trace = condense(problem)
        return FrictionContact(W=W, q=q, mu=problem.mu, dimension=problem.dimension), trace
