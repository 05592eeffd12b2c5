"""Rolling frictional contact → cone complementarity problem (equation (17)).

Source  u = Wr + q,  K* ∋ û = u + (μ‖u_T‖ + μ_r‖ω‖)e_N ⟂ r ∈ K = {‖r_T‖ ≤ μ r_N, ‖m‖ ≤ μ_r r_N}.
Target  K ∋ x ⟂ F(x) ∈ K* with F(x) = û in units of the problem, r = Dx, where μ_r has units too (`contact_maps`).
Lift    Dx.        Push  D⁻¹r.
Kind    equivalent. F is not differentiable where u_T or ω is 0, and not monotone.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import contact_maps
from cpbench.conversions.base import Conversion, conversions
from cpbench.conversions.contact_maps import Units
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.conic import cone_fields
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.cp import CP, CPPoint
from cpbench.formulations.rfc import RollingFrictionContact
from cpbench.product_cones import Cone, ProductCone


@conversions.register("rfc-cp")
@dataclass(frozen=True)
class RFCtoCP(Conversion):
    """The law of Acary and Bourrier as it stands. Trace: `unit`, `size`."""

    name = "rfc-cp"
    source = "rfc"
    target = "cp"
    equation = "(17)"
    kind = Kind.EQUIVALENT
    cost = 3.0

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for a digit more, as `fc-cp`."""
        return 0.1 * tolerance

    def apply(self, problem: RollingFrictionContact) -> tuple[CP, Trace]:
        chosen = contact_maps.units(problem)
        mu_r = contact_maps.rolling_coefficient(problem, chosen)
        K = ProductCone.of((Cone.ROLLING, problem.nc, problem.dimension, problem.mu, mu_r))
        F = contact_maps.shifted(problem, chosen)
        return CP(F=F, **cone_fields(K)), chosen.trace  # pyright: ignore[reportArgumentType]

    def lift(self, point: CPPoint, trace: Trace) -> FCPoint:
        return Units.of_trace(trace).reactions(point.x)

    def push(self, point: FCPoint, trace: Trace) -> CPPoint:
        return CPPoint(x=Units.of_trace(trace).own(point), lam=())  # pyright: ignore[reportArgumentType]
