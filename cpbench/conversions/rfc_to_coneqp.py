"""Rolling frictional contact → cone QP, De Saxcé's shift frozen.

Source  u = Wr + q,  K* ∋ u + (μ‖u_T‖ + μ_r‖ω‖)e_N ⟂ r ∈ K, K the rolling cone,  W symmetric.
Target  min ½rᵀWr + (q + s e_N)ᵀr over r ∈ ΠK, with s_c given for μ_c‖u_Tc‖ + μ_rc‖ω_c‖ (0 by default).
Lift    r.        Push  r, y = Wr + q + s e_N.
Kind    relaxation: exact where no contact moves along or turns, open ones included; one step of the fixed point on s
        otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import frozen
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.coneqp import ConeQP, ConeQPPoint
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.rfc import RollingFrictionContact
from cpbench.foundation.product_cones import Cone, ProductCone


@conversions.register("rfc-coneqp")
@dataclass(frozen=True)
class RFCtoConeQP(Conversion):
    """`slip`: s_c [m/s], one number a contact, none for s = 0. Trace: `W`, `q` (shifted)."""

    name = "rfc-coneqp"
    source = "rfc"
    target = "coneqp"
    equation = "De Saxcé, frozen"
    kind = Kind.RELAXATION
    cost = 3.0

    slip: tuple[float, ...] = ()

    def obstacle(self, problem: RollingFrictionContact) -> str | None:
        instead = "no conversion without a gradient leads to coneqp"
        return frozen.wrong_count("slip", self.slip, problem) or frozen.asymmetric("W", problem.W, instead)

    def apply(self, problem: RollingFrictionContact) -> tuple[ConeQP, Trace]:
        self.require(problem)
        q = frozen.velocity(problem, frozen.per_contact(self.slip, problem.nc))
        K = ProductCone.of((Cone.ROLLING, problem.nc, problem.dimension, problem.mu, problem.mu_r))
        return ConeQP.over(problem.W, q, K), {"W": problem.W, "q": q}

    def lift(self, point: ConeQPPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=point.x)

    def push(self, point: FCPoint, trace: Trace) -> ConeQPPoint:
        return ConeQPPoint(x=point.r, y=trace["W"] @ point.r + trace["q"])
