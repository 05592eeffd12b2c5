"""Rolling frictional contact → variational inequality (equation (22)).

Source  u = Wr + q,  K* ∋ û = u + (μ‖u_T‖ + μ_r‖ω‖)e_N ⟂ r ∈ K = {‖r_T‖ ≤ μ r_N, ‖m‖ ≤ μ_r r_N}.
Target  F(x)ᵀ(y − x) ≥ 0 for all y ∈ ΠK with F(x) = û in units of the problem, r = Dx (`contact_maps`).
Lift    Dx.        Push  D⁻¹r.
Kind    equivalent: a variational inequality over a cone is its complementarity problem. F is not monotone.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import contact_maps
from cpbench.conversions.base import Conversion, conversions
from cpbench.conversions.contact_maps import Units
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.conic import cone_fields
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.rfc import RollingFrictionContact
from cpbench.formulations.variational import VIPoint
from cpbench.formulations.vi import VI
from cpbench.product_cones import Cone, ProductCone


@conversions.register("rfc-vi")
@dataclass(frozen=True)
class RFCtoVI(Conversion):
    """The law of Acary and Bourrier over the product of the rolling cones. Trace: `unit`, `size`."""

    name = "rfc-vi"
    source = "rfc"
    target = "vi"
    equation = "(22)"
    kind = Kind.EQUIVALENT
    cost = 3.0

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for a digit more, as `fc-cp`."""
        return 0.1 * tolerance

    def apply(self, problem: RollingFrictionContact) -> tuple[VI, Trace]:
        chosen = contact_maps.units(problem)
        mu_r = contact_maps.rolling_coefficient(problem, chosen)
        K = ProductCone.of((Cone.ROLLING, problem.nc, problem.dimension, problem.mu, mu_r))
        F = contact_maps.shifted(problem, chosen)
        return VI(F=F, **cone_fields(K)), chosen.trace  # pyright: ignore[reportArgumentType]

    def lift(self, point: VIPoint, trace: Trace) -> FCPoint:
        return Units.of_trace(trace).reactions(point.z)

    def push(self, point: FCPoint, trace: Trace) -> VIPoint:
        return VIPoint(z=Units.of_trace(trace).own(point))
