"""Conversions of qp."""

from __future__ import annotations

from functools import reduce

import numpy as np

from cpbench.conversions import elimination, kkt, nonlinear
from cpbench.conversions.base import Conversion, SameUnknowns, Size, edge
from cpbench.conversions.bounds import amplification
from cpbench.conversions.elimination import Elimination
from cpbench.conversions.qualification import WhereConvex
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.formulations.expressions import Builder, Map, Operator
from cpbench.formulations.linear import AVI, MLCP, AVIPoint, MLCPPoint
from cpbench.formulations.programs import NLP, QP, QPPoint
from cpbench.foundation import matrices
from cpbench.foundation.product_cones import Cone, ProductCone


@edge("qp-avi", equation="(1) → (22)", kind=Kind.NECESSARY, cost=1.0)
class QPtoAVI(WhereConvex):
    """QP → AVI: the gradient instead of the objective (equation (22) with F = ∇f).

    Source  min ½zᵀQz + pᵀz over X = {Az ≥ b, Cz = d, lb ≤ z ≤ ub}.
    Target  −(Qz + p) ∈ N_X(z).
    Lift    z, λ, μ;  ν = Qz + p − Aᵀλ − Cᵀμ where a bound is pressed, else 0.        Push  z, λ, μ.
    Kind    equivalent when Q is positive semidefinite, otherwise necessary (stationary points).

    Trace: `M` (Q), `q` (p) and the set, for the bounds.
    """

    matrix = "Q"

    def apply(self, problem: QP) -> tuple[AVI, Trace]:
        data = {"M": problem.Q, "q": problem.p, **kkt.polyhedron(problem)}
        return AVI(**data), data

    def lift(self, point: AVIPoint, trace: Trace) -> QPPoint:
        z, lam, mu = point.z, point.lam, point.mu
        return QPPoint(z=z, lam=lam, mu=mu, nu=kkt.pressing(trace, z, lam, mu))

    def push(self, point: QPPoint, trace: Trace) -> AVIPoint:
        return AVIPoint(z=point.z, lam=point.lam, mu=point.mu)


@edge("qp-coneqp", equation="(1)", kind=Kind.EQUIVALENT, cost=1.0)
class QPtoConeQP(Conversion):
    """QP → cone QP: inequalities are a nonnegative orthant, equalities the zero cone.

    Source  min ½zᵀQz + pᵀz  subject to  Az ≥ b (λ),  Cz = d (μ),  lb ≤ z ≤ ub (ν).
    Target  the same objective over [E; F]z − (e, g) ∈ ℝ₊ × {0}, with the finite bounds among the rows E, e and F, g (as
            in qp-mlcp).
    Lift    z and the multipliers y, sorted out to λ, μ, ν.        Push  the same, backwards.
    Kind    equivalent, for any Q: objective and feasible set are the same.

    Trace: as qp-mlcp.
    """

    def apply(self, problem: QP) -> tuple[ConeQP, Trace]:
        rows = kkt.rows(problem, problem.Q)
        target = ConeQP.over(
            (problem.Q + matrices.transpose(problem.Q)) * 0.5,
            problem.p,
            ProductCone.of((Cone.NONNEGATIVE, 1, rows.e.size), (Cone.ZERO, 1, rows.g.size)),
            matrices.block([[rows.E], [rows.F]]),
            -np.concatenate([rows.e, rows.g]),
        )
        return target, {**rows.sizes, "inequalities": rows.e.size}

    def lift(self, point: ConeQPPoint, trace: Trace) -> QPPoint:
        inequality, equality = np.split(point.y, [trace["inequalities"]])
        lam, mu, nu = kkt.split(inequality, equality, trace)
        return QPPoint(z=point.x, lam=lam, mu=mu, nu=nu)

    def push(self, point: QPPoint, trace: Trace) -> ConeQPPoint:
        return ConeQPPoint(x=point.z, y=np.concatenate(kkt.join(point.lam, point.mu, point.nu, trace)))


@edge("qp-mlcp", equation="(3)", kind=Kind.NECESSARY, cost=1.0)
class QPtoMLCP(WhereConvex):
    """QP → MLCP by its optimality conditions, Karush–Kuhn–Tucker (equation (3)).

    Source  min ½zᵀQz + pᵀz  subject to  Az ≥ b (λ),  Cz = d (μ),  lb ≤ z ≤ ub (ν, positive at lb).
            Finite bounds become rows: E = [A; I_lb; −I_ub], e = [b; lb; −ub]; a variable with lb = ub is one more
            equality, F = [C; I_fixed], g = [d; lb], instead of two inequalities with unbounded multipliers.
    Target  u = (z, μ) free, v = λ:  Qz − Fᵀμ − Eᵀλ + p = 0,  Fz − g = 0,  0 ≤ λ ⟂ Ez − e ≥ 0.
    Lift    z, λ and μ of A and C; ν = ν_lb − ν_ub + μ_fixed.        Push  the same, backwards.
    Kind    equivalent when Q is positive semidefinite, otherwise necessary (stationary points).

    Trace: `n`, `m`, `k` (sizes of z, λ, μ), and the indices `lower`, `upper`, `fixed` of the bounds that became rows.
    """

    matrix = "Q"

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


@edge("qp-nlp", equation="(1) → (10)", kind=Kind.EQUIVALENT, cost=4.0)
class QPtoNLP(SameUnknowns):
    """QP → NLP (equations (1) and (10)).

    Source  min ½zᵀQz + pᵀz  subject to  Az ≥ b (λ),  Cz = d (μ),  lb ≤ z ≤ ub (ν).
    Target  min f(z)  subject to  g(z) ≥ 0,  h(z) = 0,  lb ≤ z ≤ ub,  f(z) = Σ zᵢ (½(Qz)ᵢ + pᵢ),  g(z) = Az − b,
            h(z) = Cz − d.
    Lift    z, λ, μ, ν.        Push  the same.
    Kind    equivalent: the program is the same one. It is said to be convex where Q is positive semidefinite.
    """

    def obstacle(self, problem: QP) -> str | None:
        return nonlinear.too_large(problem.Q, problem.A, problem.C)

    def apply(self, problem: QP) -> tuple[NLP, Trace]:
        self.require(problem)
        target = NLP(
            f=_objective(problem),
            g=nonlinear.affine(problem.A, -problem.b),
            h=nonlinear.affine(problem.C, -problem.d),
            lb=problem.lb,
            ub=problem.ub,
            convex=problem.convex,
        )
        return target, {}


def _objective(problem: QP) -> Map:
    build = Builder(problem.p.size)
    rows = nonlinear.affine_rows(build, 0.5 * problem.Q, problem.p)
    terms = [build.apply(Operator.MUL, i, row) for i, row in enumerate(rows)]
    total = reduce(lambda a, b: build.apply(Operator.ADD, a, b), terms) if terms else build.constant(0.0)
    return build.finish([total])


@edge("qp-qp-dual", equation="(9)", cost=3.0)
class QPtoDual(Elimination):
    """QP → its dual (equation (9)): multipliers are the unknowns, Q is eliminated.

    Source  min ½zᵀQz + pᵀz  subject to  Ez ≥ e (λ),  Fz = g (μ), Q positive definite; bounds are rows of E and F.
    Target  with G = [E; F], c = (e, g):  min ½yᵀ(G Q⁻¹Gᵀ)y − (G Q⁻¹p + c)ᵀy  over y = (λ ≥ 0, μ free).
    Lift    z = Q⁻¹(Gᵀy − p), y sorted out to λ, μ, ν, with 0 for a λ that is less than the slack of its row at z over
            the diagonal of G Q⁻¹Gᵀ: of the two, the smaller counts as 0. A far bound has a slack in whose units an
            error of λ is nothing, and all of z.        Push  y;  the multiplier of λ ≥ 0 is Ez − e.
    Kind    equivalent while eps cond(Q) <= 1e-8 (`elimination.LOSSLESS`), one-way beyond: the target may then lack
            solutions of the source, and what is lifted is as exact as rounding leaves it. Refused from cond(Q) = 1e13
            on. Q is factored once and not inverted; it travels in the trace with G and p. The dual of a QP with many
            more rows than unknowns is large and singular. Without equalities it is the LCP(EQ⁻¹Eᵀ, −(EQ⁻¹p + e)).

    Trace: as qp-mlcp, with `factor` (Q), `G`, `p`, `c`, `inequalities`, `shift`, `diagonal` (of G Q⁻¹Gᵀ).
    """

    eliminated = "Q"

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
