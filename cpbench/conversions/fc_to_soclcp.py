"""Frictional contact → cone LCP, De Saxcé's shift frozen; W need not be symmetric.

Source  u = Wr + q,  K*_μ ∋ u + μ‖u_T‖e_N ⟂ r ∈ K_μ.
Target  K*_μ ∋ Wr + q + s e_N ⟂ r ∈ K_μ, with s_c given for μ_c‖u_Tc‖ (0 by default).
Lift    r.        Push  r.
Kind    relaxation: exact where no contact moves along, open ones included (see fc-coneqp), one step of the fixed point
        on s otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import frozen
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.conic import cone_fields
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.soclcp import SOCLCP, SOCLCPPoint
from cpbench.foundation.product_cones import Cone, ProductCone


@conversions.register("fc-soclcp")
@dataclass(frozen=True)
class FCtoSOCLCP(Conversion):
    """`slip`: s_c [m/s], one number a contact, none for s = 0. Trace: empty."""

    name = "fc-soclcp"
    source = "fc"
    target = "soclcp"
    equation = "De Saxcé, frozen"
    kind = Kind.RELAXATION
    cost = 3.0

    slip: tuple[float, ...] = ()

    def obstacle(self, problem: FrictionContact) -> str | None:
        return frozen.wrong_count("slip", self.slip, problem)

    def apply(self, problem: FrictionContact) -> tuple[SOCLCP, Trace]:
        self.require(problem)
        q = frozen.velocity(problem, frozen.per_contact(self.slip, problem.nc))
        K = ProductCone.of((Cone.SECOND_ORDER, problem.nc, problem.dimension, problem.mu))
        return SOCLCP(M=problem.W, q=q, **cone_fields(K)), {}  # pyright: ignore[reportArgumentType]

    def lift(self, point: SOCLCPPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=point.x)

    def push(self, point: FCPoint, trace: Trace) -> SOCLCPPoint:
        return SOCLCPPoint(x=point.r)
