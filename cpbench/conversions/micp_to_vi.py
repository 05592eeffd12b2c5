"""MiCP → VI over a box (equations (21) and (22)).

Source  lb ≤ z ≤ ub: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
Target  F(z)ᵀ(y − z) ≥ 0 for all y ∈ X = {lb ≤ y ≤ ub}.
Lift    z.        Push  z.
Kind    equivalent: a box is a product of intervals, and the inequality is one of every component for itself.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.micp import MiCP, MiCPPoint
from cpbench.formulations.variational import VIPoint
from cpbench.formulations.vi import VI


@conversions.register("micp-vi")
@dataclass(frozen=True)
class MiCPtoVI(Conversion):
    """A MiCP read as a variational inequality. Trace: empty."""

    name = "micp-vi"
    source = "micp"
    target = "vi"
    equation = "(21) → (22)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def apply(self, problem: MiCP) -> tuple[VI, Trace]:
        return VI(F=problem.F, lb=problem.lb, ub=problem.ub, start=problem.start), {}

    def lift(self, point: VIPoint, trace: Trace) -> MiCPPoint:
        return MiCPPoint(z=point.z)

    def push(self, point: MiCPPoint, trace: Trace) -> VIPoint:
        return VIPoint(z=point.z)
