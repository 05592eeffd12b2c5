"""QP → NLP (equations (1) and (10)).

Source  min ½zᵀQz + pᵀz  subject to  Az ≥ b (λ),  Cz = d (μ),  lb ≤ z ≤ ub (ν).
Target  min f(z)  subject to  g(z) ≥ 0,  h(z) = 0,  lb ≤ z ≤ ub,  f(z) = Σ zᵢ (½(Qz)ᵢ + pᵢ),  g(z) = Az − b,
        h(z) = Cz − d.
Lift    z, λ, μ, ν.        Push  the same.
Kind    equivalent: the program is the same one. It is said to be convex where Q is positive semidefinite.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

from cpbench.conversions import maps
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.expressions import Builder, Map, Operator
from cpbench.formulations.nlp import NLP, NLPPoint
from cpbench.formulations.qp import QP, QPPoint


@conversions.register("qp-nlp")
@dataclass(frozen=True)
class QPtoNLP(Conversion):
    """A quadratic program for solvers of nonlinear ones. Trace: empty."""

    name = "qp-nlp"
    source = "qp"
    target = "nlp"
    equation = "(1) → (10)"
    kind = Kind.EQUIVALENT
    cost = 4.0

    def obstacle(self, problem: QP) -> str | None:
        return maps.too_large(problem.Q, problem.A, problem.C)

    def apply(self, problem: QP) -> tuple[NLP, Trace]:
        self.require(problem)
        target = NLP(
            f=_objective(problem),
            g=maps.affine(problem.A, -problem.b),
            h=maps.affine(problem.C, -problem.d),
            lb=problem.lb,
            ub=problem.ub,
            convex=problem.convex,
        )
        return target, {}

    def lift(self, point: NLPPoint, trace: Trace) -> QPPoint:
        return QPPoint(**point.arrays())

    def push(self, point: QPPoint, trace: Trace) -> NLPPoint:
        return NLPPoint(**point.arrays())


def _objective(problem: QP) -> Map:
    build = Builder(problem.p.size)
    terms = [
        build.apply(Operator.MUL, i, row) for i, row in enumerate(maps.affine_rows(build, 0.5 * problem.Q, problem.p))
    ]
    total = reduce(lambda a, b: build.apply(Operator.ADD, a, b), terms) if terms else build.constant(0.0)
    return build.finish([total])
