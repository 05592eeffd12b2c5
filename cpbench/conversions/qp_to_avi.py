"""QP → AVI: the gradient instead of the objective (equation (22) with F = ∇f).

Source  min ½zᵀQz + pᵀz over X = {Az ≥ b, Cz = d, lb ≤ z ≤ ub}.
Target  −(Qz + p) ∈ N_X(z).
Lift    z, λ, μ;  ν = Qz + p − Aᵀλ − Cᵀμ where a bound is pressed, else 0.        Push  z, λ, μ.
Kind    equivalent when Q is positive semidefinite, otherwise necessary (stationary points).
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import kkt
from cpbench.conversions.base import Conversion, conversions
from cpbench.conversions.convexity import indefinite
from cpbench.formulations.avi import AVI, AVIPoint
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.qp import QP, QPPoint


@conversions.register("qp-avi")
@dataclass(frozen=True)
class QPtoAVI(Conversion):
    """Stationary points over the feasible set. Trace: `M` (Q), `q` (p) and the set, for the bounds."""

    name = "qp-avi"
    source = "qp"
    target = "avi"
    equation = "(1) → (22)"
    kind = Kind.NECESSARY
    best_kind = Kind.EQUIVALENT
    cost = 1.0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, QP)
        return self.best_kind if problem.convex else self.kind

    def reservation(self, problem: QP) -> str:
        return indefinite(problem.Q, "Q")

    def apply(self, problem: QP) -> tuple[AVI, Trace]:
        data = {"M": problem.Q, "q": problem.p, **kkt.polyhedron(problem)}
        return AVI(**data), data

    def lift(self, point: AVIPoint, trace: Trace) -> QPPoint:
        z, lam, mu = point.z, point.lam, point.mu
        return QPPoint(z=z, lam=lam, mu=mu, nu=kkt.pressing(trace, z, lam, mu))

    def push(self, point: QPPoint, trace: Trace) -> AVIPoint:
        return AVIPoint(z=point.z, lam=point.lam, mu=point.mu)
