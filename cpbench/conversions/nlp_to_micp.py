"""NLP → MiCP by its optimality conditions, Karush–Kuhn–Tucker (equation (12)).

Source  min f(z)  subject to  g(z) ≥ 0 (λ),  h(z) = 0 (μ),  lb ≤ z ≤ ub (ν, positive at lb).
Target  x = (z, λ, μ),  F(x) = (∇f − ∇gᵀλ − ∇hᵀμ, g, h),  lb ≤ z ≤ ub,  λ ≥ 0,  μ free. The bounds stay bounds.
Lift    z, λ, μ; ν is the part of F that belongs to z where a bound takes it.        Push  z, λ, μ.
Kind    of a convex program equivalent where a constraint qualification is known (`qualification`), one-way without:
        a minimum may have no multipliers then. Of another one necessary (stationary points), and refused where no
        qualification is known, which `qualified` overrules.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import first_order
from cpbench.conversions.base import conversions
from cpbench.conversions.first_order import ProgramConditions
from cpbench.formulations.base import Trace
from cpbench.formulations.micp import MiCP, MiCPPoint
from cpbench.formulations.nlp import NLP, NLPPoint


@conversions.register("nlp-micp")
@dataclass(frozen=True)
class NLPtoMiCP(ProgramConditions):
    """Stationarity and complementarity of a program. `qualified`: 1 says that its minima have multipliers.

    Trace: `n`, `m`, `lb`, `ub`, and `force`, the map that says ν.
    """

    name = "nlp-micp"
    target = "micp"
    equation = "(12)"

    def apply(self, problem: NLP) -> tuple[MiCP, Trace]:
        self.require(problem)
        F, lb, ub, start, trace = first_order.program_conditions(problem)
        return MiCP(F=F, lb=lb, ub=ub, start=start), trace

    def lift(self, point: MiCPPoint, trace: Trace) -> NLPPoint:
        return first_order.program_point(point.z, trace)

    def push(self, point: NLPPoint, trace: Trace) -> MiCPPoint:
        return MiCPPoint(z=first_order.program_vector(point))
