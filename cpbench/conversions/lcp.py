"""Conversions of lcp."""

from __future__ import annotations

import numpy as np

from cpbench.conversions import nonlinear
from cpbench.conversions.base import Conversion, SameUnknowns, edge
from cpbench.conversions.qualification import WhereConvex
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.linear import AVI, LCP, MLCP, LCPPoint
from cpbench.formulations.nonlinear import NCP
from cpbench.formulations.programs import QP, QPPoint
from cpbench.foundation import matrices


@edge("lcp-avi", equation="(13) → (22)", kind=Kind.EQUIVALENT, cost=1.0)
class LCPtoAVI(SameUnknowns):
    """LCP → AVI over the orthant (equations (13) and (22)).

    Source  0 ≤ z ⟂ Mz + q ≥ 0.
    Target  −(Mz + q) ∈ N_X(z),  X = {z ≥ 0}.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def apply(self, problem: LCP) -> tuple[AVI, Trace]:
        return AVI(M=problem.M, q=problem.q, lb=np.zeros(problem.q.size)), {}


@edge("lcp-mlcp", equation="(14)", kind=Kind.EQUIVALENT, cost=1.0)
class LCPtoMLCP(SameUnknowns):
    """LCP → MLCP without free unknowns (equations (13) and (14)).

    Source  0 ≤ z ⟂ Mz + q ≥ 0.
    Target  B = M,  b = q,  v = z;  A, C, D and a are empty (n = 0).
    Lift    z = v.        Push  v = z, u empty.
    Kind    equivalent.
    """

    renamed = {"z": "v"}

    def apply(self, problem: LCP) -> tuple[MLCP, Trace]:
        M, m = problem.M, problem.q.size
        target = MLCP(
            A=matrices.zeros(0, 0, M),
            B=M,
            C=matrices.zeros(0, m, M),
            D=matrices.zeros(m, 0, M),
            a=np.zeros(0),
            b=problem.q,
        )
        return target, {}


@edge("lcp-ncp", equation="(13) → (19)", kind=Kind.EQUIVALENT, cost=4.0)
class LCPtoNCP(SameUnknowns):
    """LCP → NCP, the affine one (equations (13) and (19)).

    Source  0 ≤ z ⟂ Mz + q ≥ 0.
    Target  0 ≤ z ⟂ F(z) ≥ 0,  F(z) = Mz + q.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def obstacle(self, problem: LCP) -> str | None:
        return nonlinear.too_large(problem.M)

    def apply(self, problem: LCP) -> tuple[NCP, Trace]:
        self.require(problem)
        return NCP(F=nonlinear.affine(problem.M, problem.q)), {}


@edge("lcp-qp", equation="(1)", kind=Kind.EQUIVALENT, cost=1.0)
class LCPtoQP(Conversion):
    """LCP → QP, M symmetric positive semidefinite (equations (1) and (13)).

    Source  0 ≤ z ⟂ w = Mz + q ≥ 0.
    Target  min ½zᵀMz + qᵀz over z ≥ 0; stationarity Mz + q − ν = 0, with 0 ≤ z ⟂ ν ≥ 0: ν is w.
            z ≥ 0 is the QP's box (lb = 0), which every QP solver treats better than rows A = I, b = 0.
    Lift    z.        Push  z, ν = Mz + q.
    Kind    equivalent: the QP is convex, so its minimisers are its stationary points.

    Trace: `M`, `q`, for the multipliers of `push`.
    """

    def obstacle(self, problem: LCP) -> str | None:
        if not problem.symmetric:
            return f"M is not symmetric, asymmetry = {matrices.asymmetry(problem.M):.1e}; use lcp-qp-nonsymmetric"
        if not problem.monotone:
            least = matrices.least_eigenvalue(problem.M)
            return (
                f"M is not positive semidefinite, least eigenvalue at unit diagonal {least:.1e} or less, so a "
                "minimiser need not exist; use lcp-mlcp, or lcp-qp-nonsymmetric, which is necessary only"
            )
        return None

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for three digits more: a duality gap δ may leave a natural residual min(zᵢ, wᵢ) between δ and √δ.

        A guarantee would take ε², which methods of first order do not reach; three digits cost no measurable time.
        """
        return 1e-3 * tolerance

    def apply(self, problem: LCP) -> tuple[QP, Trace]:
        self.require(problem)
        target = QP.build(problem.M, problem.q, lb=np.zeros(problem.q.size))
        return target, {"M": problem.M, "q": problem.q}

    def lift(self, point: QPPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.z)

    def push(self, point: LCPPoint, trace: Trace) -> QPPoint:
        none = np.zeros(0)
        return QPPoint(z=point.z, lam=none, mu=none, nu=trace["M"] @ point.z + trace["q"])


@edge("lcp-qp-nonsymmetric", equation="(15)", kind=Kind.NECESSARY, cost=3.0)
class LCPtoQPNonsymmetric(WhereConvex):
    """LCP → QP for any M: minimise zᵀw over the feasible set (equation (15)).

    Source  0 ≤ z ⟂ w = Mz + q ≥ 0.
    Target  min ½zᵀ(M + Mᵀ)z + qᵀz = zᵀw  subject to  Mz ≥ −q,  z ≥ 0 (as bounds, multiplier ν).
            z solves the LCP if and only if the objective is 0; then λ = z and ν = w are multipliers.
    Lift    z.        Push  z, λ = z, ν = Mz + q.
    Kind    equivalent when M + Mᵀ is positive semidefinite (feasible implies solvable). Otherwise necessary: a solution
            of the LCP is a global minimiser, but a stationary point need not be one.

    Trace: `M`, `q`, for the multipliers of `push`.
    """

    matrix = "M"

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for ε²: a gap δ = Σ zᵢwᵢ may be one product √δ·√δ, whose natural residual min(zᵢ, wᵢ) is √δ."""
        return min(tolerance, tolerance * tolerance)

    def apply(self, problem: LCP) -> tuple[QP, Trace]:
        M, q = problem.M, problem.q
        target = QP.build(M + matrices.transpose(M), q, A=M, b=-q, lb=np.zeros(q.size))
        return target, {"M": M, "q": q}

    def lift(self, point: QPPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=point.z)

    def push(self, point: LCPPoint, trace: Trace) -> QPPoint:
        w = trace["M"] @ point.z + trace["q"]
        return QPPoint(z=point.z, lam=point.z, mu=np.zeros(0), nu=w)
