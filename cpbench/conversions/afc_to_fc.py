"""Anisotropic → isotropic frictional contact by scaling the tangents.

Source  u = Wr + q, elliptic cone {‖(r₁/μ₁, r₂/μ₂)‖ ≤ r_N}, associated slip.
Target  S = diag(1, μ₁, μ₂) a contact:  W′ = SWS,  q′ = Sq,  μ′ = 1.
Lift    r = Sr′ (and u = S⁻¹u′).        Push  r′ = S⁻¹r.
Kind    equivalent, for positive μ₁ and μ₂.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.afc import AnisotropicFrictionContact
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.foundation import matrices


@conversions.register("afc-fc")
@dataclass(frozen=True)
class AFCtoFC(Conversion):
    """The elliptic cone stretched to a circular one. Trace: `S` (a vector)."""

    name = "afc-fc"
    source = "afc"
    target = "fc"
    equation = "P_L, elliptic cone"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def apply(self, problem: AnisotropicFrictionContact) -> tuple[FrictionContact, Trace]:
        S = problem.scaling
        W = matrices.scaled_both(problem.W, S)
        return FrictionContact(W=W, q=S * problem.q, mu=np.ones(problem.nc), dimension=3), {"S": S}

    def lift(self, point: FCPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=trace["S"] * point.r)

    def push(self, point: FCPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=point.r / trace["S"])
