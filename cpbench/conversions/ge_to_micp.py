"""Generalized equation → MiCP, S a box (equations (27) and (21)).

Source  0 ∈ F(z) + N_S(z),  S = {z ∈ K : lb ≤ z ≤ ub}, K a product of {0}, ℝ and ℝ₊.
Target  the MiCP of F with the bounds of S: 0 and 0 for a factor {0}, 0 and ∞ for ℝ₊.
Lift    z.        Push  z.
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import simple_sets
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.ge import GE, GEPoint
from cpbench.formulations.micp import MiCP, MiCPPoint


@conversions.register("ge-micp")
@dataclass(frozen=True)
class GEtoMiCP(Conversion):
    """The inclusion by components. Trace: empty."""

    name = "ge-micp"
    source = "ge"
    target = "micp"
    equation = "(27) → (21)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: GE) -> str | None:
        return simple_sets.no_box(problem, "ge-vi")

    def apply(self, problem: GE) -> tuple[MiCP, Trace]:
        self.require(problem)
        lb, ub = problem.box
        return MiCP(F=problem.F, lb=lb, ub=ub, start=problem.start), {}

    def lift(self, point: MiCPPoint, trace: Trace) -> GEPoint:
        return GEPoint(z=point.z)

    def push(self, point: GEPoint, trace: Trace) -> MiCPPoint:
        return MiCPPoint(z=point.z)
