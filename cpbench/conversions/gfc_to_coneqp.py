"""Global frictional contact → cone QP in the velocities, De Saxcé's shift frozen (the dual form).

Source  Mv = Hr + Gλ + f,  Gᵀv + b = 0,  u = Hᵀv + w,  K*_μ ∋ u + μ‖u_T‖e_N ⟂ r ∈ K_μ,  M symmetric.
Target  min ½vᵀMv − fᵀv  subject to  Hᵀv + w + s e_N ∈ ΠK*_μ,  Gᵀv + b = 0, with s_c given for μ_c‖u_Tc‖.
Lift    v; r and λ are the multipliers.        Push  v, y = (r, λ).
Kind    relaxation: exact where no contact moves along, open ones included; one step of the fixed point on s otherwise
        (Acary, Cadoux, Lemaréchal and Malick 2011). Nothing is eliminated, so M may be singular.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions import frozen
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.coneqp import ConeQP, ConeQPPoint
from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.formulations.global_contact import GFCPoint
from cpbench.foundation import matrices
from cpbench.foundation.product_cones import Cone, ProductCone


@conversions.register("gfc-coneqp")
@dataclass(frozen=True)
class GFCtoConeQP(Conversion):
    """`slip`: s_c [m/s], one number a contact, none for s = 0. Trace: `contacts` (rows of H)."""

    name = "gfc-coneqp"
    source = "gfc"
    target = "coneqp"
    equation = "De Saxcé, frozen"
    kind = Kind.RELAXATION
    cost = 3.0

    slip: tuple[float, ...] = ()

    def obstacle(self, problem: GlobalFrictionContact) -> str | None:
        why = frozen.asymmetric("M", problem.M, "use gfc-fc, then fc-soclcp")
        return frozen.wrong_count("slip", self.slip, problem) or why

    def apply(self, problem: GlobalFrictionContact) -> tuple[ConeQP, Trace]:
        self.require(problem)
        d, m = problem.dimension, problem.w.size
        w = frozen.shifted(problem.w, d, frozen.per_contact(self.slip, problem.nc))
        primal = ProductCone.of((Cone.SECOND_ORDER, problem.nc, d, problem.mu), (Cone.FREE, 1, problem.b.size))
        A = matrices.block([[matrices.transpose(problem.H)], [matrices.transpose(problem.G)]])
        target = ConeQP.over(problem.M, -problem.f, primal.dual(), A, np.concatenate([w, problem.b]))
        return target, {"contacts": m}

    def lift(self, point: ConeQPPoint, trace: Trace) -> GFCPoint:
        r, lam = np.split(point.y, [trace["contacts"]])
        return GFCPoint(v=point.x, r=r, lam=lam)

    def push(self, point: GFCPoint, trace: Trace) -> ConeQPPoint:
        return ConeQPPoint(x=point.v, y=np.concatenate([point.r, point.lam]))
