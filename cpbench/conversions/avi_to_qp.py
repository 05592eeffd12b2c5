"""AVI → QP, M symmetric: the objective whose gradient is Mz + q.

Source  −(Mz + q) ∈ N_X(z),  X = {Az ≥ b, Cz = d, lb ≤ z ≤ ub}.
Target  min ½zᵀMz + qᵀz over X.
Lift    z, λ, μ.        Push  z, λ, μ;  ν = Mz + q − Aᵀλ − Cᵀμ where a bound is pressed, else 0.
Kind    equivalent when M is positive semidefinite, otherwise one-way. What a verdict on the QP accepts are its
        stationary points, with the flag `stationary` where M is indefinite, and they are the solutions, one for one.
        What the QP asks for are its minima: each is a solution, but there may be fewer of them (M = −1, q = 0 on
        [−1, 1] has the solution 0 too) or none (M = −1, q = 1 on z ≥ 0), which says nothing of the source.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import kkt
from cpbench.conversions.base import Conversion, conversions
from cpbench.conversions.convexity import indefinite
from cpbench.formulations.avi import AVI, AVIPoint
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.qp import QP, QPPoint
from cpbench.foundation import matrices


@conversions.register("avi-qp")
@dataclass(frozen=True)
class AVItoQP(Conversion):
    """A symmetric variational inequality as the conditions of a minimum. Trace: `M`, `q` and the set, for `push`."""

    name = "avi-qp"
    source = "avi"
    target = "qp"
    equation = "(22) → (1)"
    kind = Kind.ONE_WAY
    best_kind = Kind.EQUIVALENT
    cost = 1.0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, AVI)
        return self.best_kind if problem.monotone else self.kind

    def reservation(self, problem: AVI) -> str:
        return indefinite(problem.M, "M")

    def obstacle(self, problem: AVI) -> str | None:
        if problem.symmetric:
            return None
        return f"M is not symmetric, asymmetry = {matrices.asymmetry(problem.M):.1e}: it is no gradient; use avi-mlcp"

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for three digits more, as lcp-qp: a duality gap δ may leave a natural residual between δ and √δ."""
        return 1e-3 * tolerance

    def apply(self, problem: AVI) -> tuple[QP, Trace]:
        self.require(problem)
        polyhedron = kkt.polyhedron(problem)
        return QP(Q=problem.M, p=problem.q, **polyhedron), {"M": problem.M, "q": problem.q, **polyhedron}

    def lift(self, point: QPPoint, trace: Trace) -> AVIPoint:
        return AVIPoint(z=point.z, lam=point.lam, mu=point.mu)

    def push(self, point: AVIPoint, trace: Trace) -> QPPoint:
        z, lam, mu = point.z, point.lam, point.mu
        return QPPoint(z=z, lam=lam, mu=mu, nu=kkt.pressing(trace, z, lam, mu))
