"""QP → its dual (equation (9)): multipliers are the unknowns, Q is eliminated.

Source  min ½zᵀQz + pᵀz  subject to  Ez ≥ e (λ),  Fz = g (μ), Q positive definite; bounds are rows of E and F.
Target  with G = [E; F], c = (e, g):  min ½yᵀ(G Q⁻¹Gᵀ)y − (G Q⁻¹p + c)ᵀy  over y = (λ ≥ 0, μ free).
Lift    z = Q⁻¹(Gᵀy − p), y sorted out to λ, μ, ν, with 0 for a λ that is less than the slack of its row at z over the
        diagonal of G Q⁻¹Gᵀ: of the two, the smaller counts as 0. A far bound has a slack in whose units an error of λ
        is nothing, and all of z.        Push  y;  the multiplier of λ ≥ 0 is Ez − e.
Kind    equivalent while eps cond(Q) <= 1e-8 (`elimination.LOSSLESS`), one-way beyond: the target may then lack
        solutions of the source, and what is lifted is as exact as rounding leaves it. Refused from cond(Q) = 1e13 on.
        Q is factored once and not inverted; it travels in the trace with G and p. The dual of a QP with many more rows
        than unknowns is large and singular. Without equalities it is the LCP(EQ⁻¹Eᵀ, −(EQ⁻¹p + e)).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions import elimination, kkt
from cpbench.conversions.base import Conversion, Size, conversions
from cpbench.conversions.shift import amplification
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.qp import QP, QPPoint
from cpbench.foundation import matrices


@conversions.register("qp-qp-dual")
@dataclass(frozen=True)
class QPtoDual(Conversion):
    """Dual of a strictly convex QP. Trace: as qp-mlcp, with `factor` (Q), `G`, `p`, `c`, `inequalities`, `shift`,
    `diagonal` (of G Q⁻¹Gᵀ)."""

    name = "qp-qp-dual"
    source = "qp"
    target = "qp"
    equation = "(9)"
    kind = Kind.ONE_WAY
    best_kind = Kind.EQUIVALENT
    cost = 3.0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, QP)
        return elimination.kind(problem.factorization.rcond)

    def reservation(self, problem: QP) -> str:
        return elimination.reservation(problem.factorization.rcond, "Q")

    def obstacle(self, problem: QP) -> str | None:
        singular = elimination.singularity(
            problem.factorization, "Q", "use qp-mlcp or qp-coneqp, which need no inverse"
        )
        if singular is None and not problem.convex:
            least = matrices.least_eigenvalue(problem.Q)
            return f"Q is not positive definite, least eigenvalue at unit diagonal {least:.1e} or less; use qp-mlcp"
        return singular

    def predict(self, problem: QP) -> Size:
        rows = kkt.rows(problem, problem.Q)
        G = matrices.block([[rows.E], [rows.F]])
        return elimination.size_bound(G, problem.factorization, matrices.transpose(G))

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for more, for the terms that cancel on the way back (see `shift`)."""
        return tolerance / trace["shift"]

    def apply(self, problem: QP) -> tuple[QP, Trace]:
        self.require(problem)
        rows = kkt.rows(problem, problem.Q)
        G, c = matrices.block([[rows.E], [rows.F]]), np.concatenate([rows.e, rows.g])
        factor = problem.factorization
        prices = elimination.less(-c, G, factor, problem.p)
        target = QP.build(
            elimination.congruence(matrices.transpose(G), factor),
            prices,
            lb=np.concatenate([np.zeros(rows.e.size), np.full(rows.g.size, -np.inf)]),
        )
        return target, {
            **rows.sizes,
            "factor": factor,
            "G": G,
            "p": problem.p,
            "c": c,
            "inequalities": rows.e.size,
            "shift": amplification(prices + c, c),
            "diagonal": target.Q.diagonal(),
        }

    def lift(self, point: QPPoint, trace: Trace) -> QPPoint:
        y, factor, G = point.z.copy(), trace["factor"], trace["G"]
        z = factor.solve(G.T @ y - trace["p"])
        idle = G @ z - trace["c"] > np.abs(y) * trace["diagonal"]
        idle[trace["inequalities"] :] = False
        if y[idle].any():
            y[idle] = 0.0
            z = factor.solve(G.T @ y - trace["p"])
        lam, mu, nu = kkt.split(*np.split(y, [trace["inequalities"]]), trace)
        return QPPoint(z=z, lam=lam, mu=mu, nu=nu)

    def push(self, point: QPPoint, trace: Trace) -> QPPoint:
        slack = trace["G"] @ point.z - trace["c"]
        slack[trace["inequalities"] :] = 0.0
        none = np.zeros(0)
        return QPPoint(z=np.concatenate(kkt.join(point.lam, point.mu, point.nu, trace)), lam=none, mu=none, nu=slack)
