"""NLP → generalized equation by its optimality conditions (equations (29) and (30), the signs of g and h mended).

Source  min f(z)  subject to  g(z) ≥ 0 (λ),  h(z) = 0 (μ),  lb ≤ z ≤ ub (ν, positive at lb).
Target  0 ∈ F(x) + N_S(x),  x = (z, λ, μ),  F(x) = (∇f − ∇gᵀλ − ∇hᵀμ, g, h),  S = [lb, ub] × ℝ₊ × ℝ.
Lift    z, λ, μ; ν is the part of F that belongs to z where a bound takes it.        Push  z, λ, μ.
Kind    as of nlp-micp: equivalent, one-way or necessary, or refused.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import first_order
from cpbench.conversions.base import conversions
from cpbench.conversions.first_order import ProgramConditions
from cpbench.formulations.base import Trace
from cpbench.formulations.ge import GE, GEPoint
from cpbench.formulations.nlp import NLP, NLPPoint


@conversions.register("nlp-ge")
@dataclass(frozen=True)
class NLPtoGE(ProgramConditions):
    """Stationarity as an inclusion. `qualified`: 1 says that the minima have multipliers. Trace: as of nlp-micp."""

    name = "nlp-ge"
    target = "ge"
    equation = "(29), (30)"

    def apply(self, problem: NLP) -> tuple[GE, Trace]:
        self.require(problem)
        F, lb, ub, start, trace = first_order.program_conditions(problem)
        return GE(F=F, lb=lb, ub=ub, start=start), trace

    def lift(self, point: GEPoint, trace: Trace) -> NLPPoint:
        return first_order.program_point(point.z, trace)

    def push(self, point: NLPPoint, trace: Trace) -> GEPoint:
        return GEPoint(z=first_order.program_vector(point))
