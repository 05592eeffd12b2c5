"""QP → MLCP by its optimality conditions, Karush–Kuhn–Tucker (equation (3)).

Source  min ½zᵀQz + pᵀz  subject to  Az ≥ b (λ),  Cz = d (μ),  lb ≤ z ≤ ub (ν, positive at lb).
        Finite bounds become rows: E = [A; I_lb; −I_ub], e = [b; lb; −ub]; a variable with lb = ub is one more
        equality, F = [C; I_fixed], g = [d; lb], instead of two inequalities with unbounded multipliers.
Target  u = (z, μ) free, v = λ:  Qz − Fᵀμ − Eᵀλ + p = 0,  Fz − g = 0,  0 ≤ λ ⟂ Ez − e ≥ 0.
Lift    z, λ and μ of A and C; ν = ν_lb − ν_ub + μ_fixed.        Push  the same, backwards.
Kind    equivalent when Q is positive semidefinite, otherwise necessary (stationary points).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions import kkt
from cpbench.conversions.base import Conversion, conversions
from cpbench.conversions.convexity import indefinite
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.mlcp import MLCP, MLCPPoint
from cpbench.formulations.qp import QP, QPPoint


@conversions.register("qp-mlcp")
@dataclass(frozen=True)
class QPtoMLCP(Conversion):
    """Stationarity and complementarity of a QP.

    Trace: `n`, `m`, `k` (sizes of z, λ, μ), and the indices `lower`, `upper`, `fixed` of the bounds that became rows.
    """

    name = "qp-mlcp"
    source = "qp"
    target = "mlcp"
    equation = "(3)"
    kind = Kind.NECESSARY
    best_kind = Kind.EQUIVALENT
    cost = 1.0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, QP)
        return self.best_kind if problem.convex else self.kind

    def reservation(self, problem: QP) -> str:
        return indefinite(problem.Q, "Q")

    def apply(self, problem: QP) -> tuple[MLCP, Trace]:
        constraints = kkt.rows(problem, problem.Q)
        return kkt.conditions(problem.Q, problem.p, constraints), constraints.sizes

    def lift(self, point: MLCPPoint, trace: Trace) -> QPPoint:
        z, equality = np.split(point.u, [trace["n"]])
        lam, mu, nu = kkt.split(point.v, equality, trace)
        return QPPoint(z=z, lam=lam, mu=mu, nu=nu)

    def push(self, point: QPPoint, trace: Trace) -> MLCPPoint:
        inequality, equality = kkt.join(point.lam, point.mu, point.nu, trace)
        return MLCPPoint(u=np.concatenate([point.z, equality]), v=inequality)
