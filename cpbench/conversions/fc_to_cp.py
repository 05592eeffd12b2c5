"""Frictional contact → cone complementarity problem (equation (17)).

Source  u = Wr + q,  K*_μ ∋ û = u + μ‖u_T‖e_N ⟂ r ∈ K_μ at every contact.
Target  K_μ ∋ x ⟂ F(x) ∈ K*_μ with F(x) = û in units of the problem, r = Dx (`contact_maps`).
Lift    Dx.        Push  D⁻¹r.
Kind    equivalent. F is not differentiable where a tangential velocity is 0; the derivative given there is that of
        no slip. It is not monotone either, whatever W is.
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
from cpbench.formulations.fc import FrictionContact
from cpbench.product_cones import Cone, ProductCone


@conversions.register("fc-cp")
@dataclass(frozen=True)
class FCtoCP(Conversion):
    """De Saxcé's law as it stands. Trace: `unit`, `size`."""

    name = "fc-cp"
    source = "fc"
    target = "cp"
    equation = "(17)"
    kind = Kind.EQUIVALENT
    cost = 3.0

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for a digit more: the target's error is over ‖q̂‖, that of contact over ‖q‖, and once in other units."""
        return 0.1 * tolerance

    def apply(self, problem: FrictionContact) -> tuple[CP, Trace]:
        chosen = contact_maps.units(problem)
        K = ProductCone.of((Cone.SECOND_ORDER, problem.nc, problem.dimension, problem.mu))
        F = contact_maps.shifted(problem, chosen)
        return CP(F=F, **cone_fields(K)), chosen.trace  # pyright: ignore[reportArgumentType]

    def lift(self, point: CPPoint, trace: Trace) -> FCPoint:
        return Units.of_trace(trace).reactions(point.x)

    def push(self, point: FCPoint, trace: Trace) -> CPPoint:
        return CPPoint(x=Units.of_trace(trace).own(point), lam=())  # pyright: ignore[reportArgumentType]
