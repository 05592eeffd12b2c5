"""NLP → QP, f quadratic, g and h affine (equations (10) and (1)).

Source  min f(z)  subject to  g(z) = Az − b ≥ 0,  h(z) = Cz − d = 0,  lb ≤ z ≤ ub;  f(z) = f(0) + pᵀz + ½zᵀQz.
Target  min ½zᵀQz + pᵀz  subject to  Az ≥ b,  Cz = d,  lb ≤ z ≤ ub; the number f(0) is left out.
Lift    z, λ, μ, ν.        Push  the same.
Kind    equivalent: the program is the same one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions import maps
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.expressions.derivatives import has_constant_curvature
from cpbench.formulations.nlp import NLP, NLPPoint
from cpbench.formulations.qp import QP, QPPoint
from cpbench.foundation import matrices


@conversions.register("nlp-qp")
@dataclass(frozen=True)
class NLPtoQP(Conversion):
    """A nonlinear program that is quadratic, for solvers of quadratic ones. Trace: empty."""

    name = "nlp-qp"
    source = "nlp"
    target = "qp"
    equation = "(10) → (1)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: NLP) -> str | None:
        why = maps.curved(problem.g, "g") or maps.curved(problem.h, "h")
        if why is None and not has_constant_curvature(problem.f):
            why = "f is not quadratic: its Hessian depends on z"
        return f"{why}; use nlp-micp" if why else None

    def apply(self, problem: NLP) -> tuple[QP, Trace]:
        self.require(problem)
        zero = np.zeros(problem.start.size)
        g, h = problem.g.compiled, problem.h.compiled
        target = QP(
            Q=problem.f.hessian(zero, np.ones(1)),
            p=matrices.dense(problem.f.jacobian(zero)).ravel(),
            A=g.M,
            b=-g.q,
            C=h.M,
            d=-h.q,
            lb=problem.lb,
            ub=problem.ub,
        )
        return target, {}

    def lift(self, point: QPPoint, trace: Trace) -> NLPPoint:
        return NLPPoint(**point.arrays())

    def push(self, point: NLPPoint, trace: Trace) -> QPPoint:
        return QPPoint(**point.arrays())
