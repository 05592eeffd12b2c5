"""Frictional contact → strictly convex cone QP: contacts that give way, and dilate where they slide.

Source  u = Wr + q,  K*_μ ∋ u + μ‖u_T‖e_N ⟂ r ∈ K_μ,  W symmetric.
Target  min ½rᵀ(W + R)r + qᵀr over r ∈ ΠK_μ, R = κ diag(1/ρ_c), ρ_c = d/tr W_cc: every contact has κ times the mean of
        its own mobilities in series with them.
Lift    r.        Push  r, y = (W + R)r + q.
Kind    relaxation: MuJoCo's model of contact (Todorov 2014), whose forces are unique where the rigid law's are not. It
        drops De Saxcé's term, as `fc-coneqp` does, and lets a contact sink with the velocity (Rr)_N.

The default κ is that of MuJoCo's hardest contact, impedance d = 0.9999: κ = (1 − d)/d.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cpbench.conversions import frozen
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.coneqp import ConeQP, ConeQPPoint
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.foundation.matrices import with_diagonal
from cpbench.foundation.product_cones import Cone, ProductCone


@conversions.register("fc-coneqp-compliant")
@dataclass(frozen=True)
class FCtoCompliantConeQP(Conversion):
    """`compliance`: κ, relative to the contact's own. Trace: `W` (with R), `q`."""

    name = "fc-coneqp-compliant"
    source = "fc"
    target = "coneqp"
    equation = "Todorov 2014"
    kind = Kind.RELAXATION
    cost = 3.5

    compliance: float = 1e-4

    def obstacle(self, problem: FrictionContact) -> str | None:
        if not 0 < self.compliance < math.inf:
            return f"compliance is {self.compliance:g}, expected a number > 0; use fc-coneqp for none"
        return frozen.asymmetric("W", problem.W, "use fc-soclcp")

    def apply(self, problem: FrictionContact) -> tuple[ConeQP, Trace]:
        self.require(problem)
        R = np.repeat(self.compliance / problem.rho, problem.dimension)
        W = with_diagonal(problem.W, R)
        K = ProductCone.of((Cone.SECOND_ORDER, problem.nc, problem.dimension, problem.mu))
        target = ConeQP.over(W, problem.q, K)
        return target, {"W": target.Q, "q": problem.q}

    def lift(self, point: ConeQPPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=point.x)

    def push(self, point: FCPoint, trace: Trace) -> ConeQPPoint:
        return ConeQPPoint(x=point.r, y=trace["W"] @ point.r + trace["q"])
