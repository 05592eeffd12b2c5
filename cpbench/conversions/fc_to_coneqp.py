"""Frictional contact → cone QP, De Saxcé's shift frozen.

Source  u = Wr + q,  K*_μ ∋ u + μ‖u_T‖e_N ⟂ r ∈ K_μ,  W symmetric.
Target  min ½rᵀWr + (q + s e_N)ᵀr over r ∈ ΠK_μ, with s_c given for μ_c‖u_Tc‖ (0 by default).
Lift    r.        Push  r, y = Wr + q + s e_N.
Kind    relaxation: with s = 0 that of Anitescu and Tasora, exact where no contact moves along, open ones included
        (W = I, q = (0.1, 1, 0), μ = 0.5: the law has r = 0, the relaxation r_N = 0.32); one step of the fixed point on
        s (Haslinger; Acary and Cadoux) otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import frozen
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.coneqp import ConeQP, ConeQPPoint
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.foundation.product_cones import Cone, ProductCone


@conversions.register("fc-coneqp")
@dataclass(frozen=True)
class FCtoConeQP(Conversion):
    """`slip`: s_c [m/s], one number a contact, none for s = 0. Trace: `W`, `q` (shifted)."""

    name = "fc-coneqp"
    source = "fc"
    target = "coneqp"
    equation = "De Saxcé, frozen"
    kind = Kind.RELAXATION
    cost = 3.0

    slip: tuple[float, ...] = ()

    def obstacle(self, problem: FrictionContact) -> str | None:
        return frozen.wrong_count("slip", self.slip, problem) or frozen.asymmetric("W", problem.W, "use fc-soclcp")

    def apply(self, problem: FrictionContact) -> tuple[ConeQP, Trace]:
        self.require(problem)
        q = frozen.velocity(problem, frozen.per_contact(self.slip, problem.nc))
        K = ProductCone.of((Cone.SECOND_ORDER, problem.nc, problem.dimension, problem.mu))
        return ConeQP.over(problem.W, q, K), {"W": problem.W, "q": q}

    def lift(self, point: ConeQPPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=point.x)

    def push(self, point: FCPoint, trace: Trace) -> ConeQPPoint:
        return ConeQPPoint(x=point.r, y=trace["W"] @ point.r + trace["q"])
