"""Generalized equation → VI (equations (24) and (27)).

Source  0 ∈ F(z) + N_S(z),  S = {z ∈ K : lb ≤ z ≤ ub}.
Target  F(z)ᵀ(y − z) ≥ 0 for all y ∈ S.
Lift    z.        Push  z.
Kind    equivalent: that is what a normal cone is.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.ge import GE, GEPoint
from cpbench.formulations.variational import VIPoint
from cpbench.formulations.vi import VI


@conversions.register("ge-vi")
@dataclass(frozen=True)
class GEtoVI(Conversion):
    """The inclusion as an inequality. Trace: empty."""

    name = "ge-vi"
    source = "ge"
    target = "vi"
    equation = "(27) → (22)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def apply(self, problem: GE) -> tuple[VI, Trace]:
        return VI(F=problem.F, **problem.data()), {}  # pyright: ignore[reportArgumentType]

    def lift(self, point: VIPoint, trace: Trace) -> GEPoint:
        return GEPoint(z=point.z)

    def push(self, point: GEPoint, trace: Trace) -> VIPoint:
        return VIPoint(z=point.z)
