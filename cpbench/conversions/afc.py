"""Conversions of afc."""

from __future__ import annotations

import numpy as np

from cpbench.conversions.base import Conversion, edge
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.local_contact import AnisotropicFrictionContact, FrictionContact
from cpbench.foundation import matrices


@edge("afc-fc", equation="P_L, elliptic cone", kind=Kind.EQUIVALENT, cost=1.0)
class AFCtoFC(Conversion):
    """Anisotropic → isotropic frictional contact by scaling the tangents.

    Source  u = Wr + q, elliptic cone {‖(r₁/μ₁, r₂/μ₂)‖ ≤ r_N}, associated slip.
    Target  S = diag(1, μ₁, μ₂) a contact:  W′ = SWS,  q′ = Sq,  μ′ = 1.
    Lift    r = Sr′ (and u = S⁻¹u′).        Push  r′ = S⁻¹r.
    Kind    equivalent, for positive μ₁ and μ₂.

    Trace: `S` (a vector).
    """

    def apply(self, problem: AnisotropicFrictionContact) -> tuple[FrictionContact, Trace]:
        S = problem.scaling
        W = matrices.scaled_both(problem.W, S)
        return FrictionContact(W=W, q=S * problem.q, mu=np.ones(problem.nc), dimension=3), {"S": S}

    def lift(self, point: FCPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=trace["S"] * point.r)

    def push(self, point: FCPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=point.r / trace["S"])
