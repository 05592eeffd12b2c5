"""Conversions of avi."""

from __future__ import annotations

import numpy as np

from cpbench.conversions import kkt, nonlinear
from cpbench.conversions.base import Conversion, SameUnknowns, edge
from cpbench.conversions.bounds import FromBounds
from cpbench.conversions.qualification import WhereConvex
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.linear import AVI, MLCP, AVIPoint, MLCPPoint, Relay
from cpbench.formulations.programs import QP, QPPoint
from cpbench.formulations.variational import VI
from cpbench.foundation import matrices


@edge("avi-lcp-bounds", equation="(22) → (13)", kind=Kind.EQUIVALENT, cost=1.0)
class AVItoLCPBounds(FromBounds):
    """AVI over a box → LCP; bounds may be missing on one side.

    Source  −(Mz + q) ∈ N_[lb,ub](z), every variable bounded on one side at least, no rows beside.
    Target  z = c + Sx, c the bound nearer to 0, S = 1 for lb and −1 for ub; y ≥ 0 where both bounds are finite:
            0 ≤ x ⟂ SMSx + Jᵀy + S(q + Mc) ≥ 0,  0 ≤ y ⟂ ub − lb − Jx ≥ 0.
    Lift    z = c + Sx.        Push  x = S(z − c),  y = max(−S(Mz + q), 0).
    Kind    equivalent.

    Trace: see `bounds`.
    """

    def obstacle(self, problem: AVI | Relay) -> str | None:
        assert isinstance(problem, AVI)
        if not problem.only_box:
            rows = problem.b.size + problem.d.size
            return f"the set has {rows} rows beside its bounds; use avi-mlcp"
        free = np.flatnonzero(np.isinf(problem.lb) & np.isinf(problem.ub))
        if free.size:
            return f"{free.size} variables have no bound, the first is {free[0]}; use avi-mlcp"
        return super().obstacle(problem)


@edge("avi-mlcp", equation="(22) → (14)", kind=Kind.EQUIVALENT, cost=1.0)
class AVItoMLCP(Conversion):
    """AVI → MLCP by multipliers of the polyhedron.

    Source  −(Mz + q) ∈ N_X(z),  X = {Az ≥ b, Cz = d, lb ≤ z ≤ ub}.
    Target  with finite bounds among the rows E, e and F, g (as in qp-mlcp), u = (z, μ) free, v = λ:
            Mz + q − Fᵀμ − Eᵀλ = 0,  Fz − g = 0,  0 ≤ λ ⟂ Ez − e ≥ 0.
    Lift    z, λ and μ of A and C.        Push  the same, with ν = Mz + q − Aᵀλ − Cᵀμ for the bounds that are
            pressed.
    Kind    equivalent: X is a polyhedron, so the multipliers exist for every M.

    Trace: sizes and indices as qp-mlcp; `M`, `q` and the set for the multipliers of `push`.
    """

    def apply(self, problem: AVI) -> tuple[MLCP, Trace]:
        constraints = kkt.rows(problem, problem.M)
        kept = {"M": problem.M, "q": problem.q, **kkt.polyhedron(problem)}
        return kkt.conditions(problem.M, problem.q, constraints), {**constraints.sizes, **kept}

    def lift(self, point: MLCPPoint, trace: Trace) -> AVIPoint:
        z, equality = np.split(point.u, [trace["n"]])
        lam, mu, _ = kkt.split(point.v, equality, trace)
        return AVIPoint(z=z, lam=lam, mu=mu)

    def push(self, point: AVIPoint, trace: Trace) -> MLCPPoint:
        z, lam, mu = point.z, point.lam, point.mu
        nu = kkt.pressing(trace, z, lam, mu)
        inequality, equality = kkt.join(lam, mu, nu, trace)
        return MLCPPoint(u=np.concatenate([z, equality]), v=inequality)


@edge("avi-qp", equation="(22) → (1)", kind=Kind.ONE_WAY, cost=1.0)
class AVItoQP(WhereConvex):
    """AVI → QP, M symmetric: the objective whose gradient is Mz + q.

    Source  −(Mz + q) ∈ N_X(z),  X = {Az ≥ b, Cz = d, lb ≤ z ≤ ub}.
    Target  min ½zᵀMz + qᵀz over X.
    Lift    z, λ, μ.        Push  z, λ, μ;  ν = Mz + q − Aᵀλ − Cᵀμ where a bound is pressed, else 0.
    Kind    equivalent when M is positive semidefinite, otherwise one-way. What a verdict on the QP accepts are its
            stationary points, with the flag `stationary` where M is indefinite, and they are the solutions, one for
            one. What the QP asks for are its minima: each is a solution, but there may be fewer of them (M = −1, q = 0
            on [−1, 1] has the solution 0 too) or none (M = −1, q = 1 on z ≥ 0), which says nothing of the source.

    Trace: `M`, `q` and the set, for `push`.
    """

    matrix = "M"

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


@edge("avi-relay", equation="(22)", kind=Kind.EQUIVALENT, cost=1.0)
class AVItoRelay(SameUnknowns):
    """AVI over a finite box → relay.

    Source  −(Mz + q) ∈ N_[lb,ub](z), bounds finite, no rows beside.
    Target  the same.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def obstacle(self, problem: AVI) -> str | None:
        if not problem.only_box:
            rows = problem.b.size + problem.d.size
            return f"the set has {rows} rows beside its bounds, a relay has a box; use avi-mlcp"
        infinite = int(np.isinf(problem.lb).sum() + np.isinf(problem.ub).sum())
        if infinite:
            return f"{infinite} bounds are infinite, those of a relay are finite; use avi-lcp-bounds or avi-mlcp"
        return None

    def apply(self, problem: AVI) -> tuple[Relay, Trace]:
        self.require(problem)
        return Relay(M=problem.M, q=problem.q, lb=problem.lb, ub=problem.ub), {}


@edge("avi-vi", equation="(22)", kind=Kind.EQUIVALENT, cost=4.0)
class AVItoVI(SameUnknowns):
    """AVI → VI (equation (22)).

    Source  −(Mz + q) ∈ N_X(z),  X = {z : Az ≥ b, Cz = d, lb ≤ z ≤ ub}.
    Target  −F(z) ∈ N_X(z),  F(z) = Mz + q.
    Lift    z, λ, μ.        Push  the same.
    Kind    equivalent.
    """

    def obstacle(self, problem: AVI) -> str | None:
        return nonlinear.too_large(problem.M)

    def apply(self, problem: AVI) -> tuple[VI, Trace]:
        self.require(problem)
        return VI(F=nonlinear.affine(problem.M, problem.q), **kkt.polyhedron(problem)), {}
