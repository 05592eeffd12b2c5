"""The law of `fc` and `rfc` over the product of its cones, in its own units: base of the edges to `cp` and `vi`.

A steep cone hides what a contact misses. Where û_N lacks δ of being μ‖û_T‖, the distance to the dual cone is
δ/√(1 + μ²), and the rows have terms μ times larger: an error of ε of the target may be one of μ² ε here. The target is
asked for as much more, at most `shift.MOST`: beyond μ = 100 the rest is lost, and from 10⁸ on it is rounding.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from cpbench.conversions import contact_maps, shift
from cpbench.conversions.base import Conversion
from cpbench.conversions.contact_maps import Units
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.conic import cone_fields
from cpbench.formulations.contact import FCPoint, LocalContact
from cpbench.formulations.cp import CP, CPPoint
from cpbench.formulations.expressions import Map
from cpbench.formulations.rfc import RollingFrictionContact
from cpbench.formulations.variational import VIPoint
from cpbench.formulations.vi import VI
from cpbench.foundation.product_cones import Cone, ProductCone


class OverCones(Conversion):
    """Base of the edges to a problem over the cones of the law. Trace: `unit`, `size`, `steepness`."""

    kind: ClassVar[Kind] = Kind.EQUIVALENT
    cost: ClassVar[float] = 3.0

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for a digit more, for the target's error is over ‖q̂‖, that of contact over ‖q‖, and once in other units;
        and for steep cones (see above).
        """
        steepness = max(trace["steepness"], 1.0)
        return 0.1 * tolerance / min(steepness * steepness, shift.MOST)


class ToCP(OverCones):
    """Base of `fc-cp` and `rfc-cp`."""

    target: ClassVar[str] = "cp"
    equation: ClassVar[str] = "(17)"

    def apply(self, problem: LocalContact) -> tuple[CP, Trace]:
        F, cones, trace = _law(problem)
        return CP(F=F, **cones), trace

    def lift(self, point: CPPoint, trace: Trace) -> FCPoint:
        return Units.of_trace(trace).reactions(point.x)

    def push(self, point: FCPoint, trace: Trace) -> CPPoint:
        return CPPoint(x=Units.of_trace(trace).own(point), lam=())  # pyright: ignore[reportArgumentType]


class ToVI(OverCones):
    """Base of `fc-vi` and `rfc-vi`."""

    target: ClassVar[str] = "vi"
    equation: ClassVar[str] = "(22)"

    def apply(self, problem: LocalContact) -> tuple[VI, Trace]:
        F, cones, trace = _law(problem)
        return VI(F=F, **cones), trace

    def lift(self, point: VIPoint, trace: Trace) -> FCPoint:
        return Units.of_trace(trace).reactions(point.z)

    def push(self, point: FCPoint, trace: Trace) -> VIPoint:
        return VIPoint(z=Units.of_trace(trace).own(point))


def _law(problem: LocalContact) -> tuple[Map, dict[str, Any], Trace]:
    """Return F, the fields of the cones, and the trace."""
    chosen = contact_maps.units(problem)
    steep = problem.mu
    if isinstance(problem, RollingFrictionContact):
        mu_r = contact_maps.rolling_coefficient(problem, chosen)
        steep = np.concatenate([steep, mu_r])
        K = ProductCone.of((Cone.ROLLING, problem.nc, problem.dimension, problem.mu, mu_r))
    else:
        K = ProductCone.of((Cone.SECOND_ORDER, problem.nc, problem.dimension, problem.mu))
    trace = {**chosen.trace, "steepness": float(np.max(steep, initial=0.0))}
    return contact_maps.shifted(problem, chosen), dict(cone_fields(K)), trace
