"""Frictional contact → quasi-variational inequality: the disk of friction moves with the normal reaction.

Source  u = Wr + q,  0 ≤ u_N ⟂ r_N ≥ 0,  −u_T ∈ N_D(μ r_N)(r_T), D(ρ) the disk (the interval in the plane) of radius ρ.
Target  F(x)ᵀ(y − x) ≥ 0 for all y ∈ X(x) = Π ℝ₊ × D(μ x_N), F(x) = u in units of the problem, r = Dx
        (`contact_maps`). F is affine: what is not linear is the set.
Lift    Dx.        Push  D⁻¹r.
Kind    equivalent: N_X(x)(x) is the product of N_ℝ₊(x_N) and N_D(μ x_N)(x_T), which is Signorini's and Coulomb's law.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import contact_maps
from cpbench.conversions.base import Conversion, conversions
from cpbench.conversions.contact_maps import Units
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.conic import cone_fields
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.qvi import QVI, QVIPoint
from cpbench.foundation.product_cones import Cone, ProductCone


@conversions.register("fc-qvi")
@dataclass(frozen=True)
class FCtoQVI(Conversion):
    """Coulomb's law without a change of variable. Trace: `unit`, `size`."""

    name = "fc-qvi"
    source = "fc"
    target = "qvi"
    equation = "(22) with X(z)"
    kind = Kind.EQUIVALENT
    cost = 3.0

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for a digit more, as `fc-cp`."""
        return 0.1 * tolerance

    def apply(self, problem: FrictionContact) -> tuple[QVI, Trace]:
        chosen = contact_maps.units(problem)
        K = ProductCone.of((Cone.CYLINDER, problem.nc, problem.dimension, problem.mu))
        F = contact_maps.plain(problem, chosen)
        return QVI(F=F, **cone_fields(K)), chosen.trace  # pyright: ignore[reportArgumentType]

    def lift(self, point: QVIPoint, trace: Trace) -> FCPoint:
        return Units.of_trace(trace).reactions(point.z)

    def push(self, point: FCPoint, trace: Trace) -> QVIPoint:
        return QVIPoint(z=Units.of_trace(trace).own(point))
