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

from cpbench.conversions.base import conversions
from cpbench.conversions.condensation import Condensation, condense
from cpbench.formulations.base import Trace
from cpbench.formulations.grfc import GlobalRollingFrictionContact
from cpbench.formulations.rfc import RollingFrictionContact


@conversions.register("grfc-rfc")
@dataclass(frozen=True)
class GRFCtoRFC(Condensation):
    """Eliminate the velocities of the bodies and the joint reactions. Trace: `factor` (K), `H`, `f`, `b`."""

    name = "grfc-rfc"
    source = "grfc"
    target = "rfc"

    def apply(self, problem: GlobalRollingFrictionContact) -> tuple[RollingFrictionContact, Trace]:
        self.require(problem)
        W, q, trace = condense(problem)
        local = RollingFrictionContact(W=W, q=q, mu=problem.mu, mu_r=problem.mu_r, dimension=problem.dimension)
        return local, trace
