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
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.micp import MiCP, MiCPPoint
from cpbench.formulations.nlp import NLP, NLPPoint


@conversions.register("nlp-micp")
@dataclass(frozen=True)
class NLPtoMiCP(Conversion):
    """Stationarity and complementarity of a program. `qualified`: 1 says that its minima have multipliers.

    Trace: `n`, `m`, `lb`, `ub`, and `force`, the map that says ν.
    """

    name = "nlp-micp"
    source = "nlp"
    target = "micp"
    equation = "(12)"
    kind = Kind.NECESSARY
    best_kind = Kind.EQUIVALENT
    between = (Kind.ONE_WAY,)
    cost = 2.0

    qualified: int = 0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, NLP)
        return first_order.program_kind(problem)

    def reservation(self, problem: NLP) -> str:
        return first_order.program_reservation(problem)

    def obstacle(self, problem: NLP) -> str | None:
        return None if self.qualified else first_order.unsettled(problem, self.name)

    def apply(self, problem: NLP) -> tuple[MiCP, Trace]:
        self.require(problem)
        F, lb, ub, start, trace = first_order.of_program(problem)
        return MiCP(F=F, lb=lb, ub=ub, start=start), trace

    def lift(self, point: MiCPPoint, trace: Trace) -> NLPPoint:
        return first_order.program_point(point.z, trace)

    def push(self, point: NLPPoint, trace: Trace) -> MiCPPoint:
        return MiCPPoint(z=first_order.program_vector(point))
