"""Conversions of programs: qp and nlp."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import Any, ClassVar

import numpy as np

from cpbench.conversions import elimination, kkt, maps, qualification
from cpbench.conversions.base import Conversion, SameUnknowns, Size, edge
from cpbench.conversions.bounds import amplification
from cpbench.conversions.elimination import Elimination
from cpbench.conversions.qualification import WhereConvex
from cpbench.formulations.base import Kind, Problem, Trace, formulations
from cpbench.formulations.conic import ConeQP, ConeQPPoint
from cpbench.formulations.expressions import Builder, Map, Operator
from cpbench.formulations.expressions.derivatives import has_constant_curvature
from cpbench.formulations.expressions.recording import MapRecorder
from cpbench.formulations.linear import AVI, MLCP, AVIPoint, MLCPPoint
from cpbench.formulations.nonlinear import MiCPPoint
from cpbench.formulations.programs import NLP, QP, Convexity, NLPPoint, QPPoint
from cpbench.formulations.variational import GEPoint
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone, ProductCone


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


def _objective(problem: QP) -> Map:
    build = Builder(problem.p.size)
    rows = maps.affine_rows(build, 0.5 * problem.Q, problem.p)
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


@dataclass(frozen=True)
class ProgramConditions(Conversion):
    """Base of the edges from a program to its first-order conditions, with multipliers among the unknowns.

    F(x) = (∇f − ∇gᵀλ − ∇hᵀμ, g, h) of x = (z, λ, μ): beside z with its own set, inequalities have multipliers ≥ 0 and
    equalities free ones. Trace: `n`, `m`, `lb`, `ub`, and `force`, the rows of F that give ν.
    """

    kind: ClassVar[Kind] = Kind.NECESSARY
    best_kind = Kind.EQUIVALENT
    between: ClassVar[tuple[Kind, ...]] = (Kind.ONE_WAY,)
    cost: ClassVar[float] = 2.0

    qualified: int = 0

    def exactness(self, problem: NLP) -> Kind:
        if not problem.taken_as_convex:
            return Kind.NECESSARY
        return Kind.ONE_WAY if qualification.of_program(problem) else Kind.EQUIVALENT

    def reservation(self, problem: NLP) -> str:
        if problem.convexity is Convexity.REFUTED:
            return (
                "its second derivatives show that the program is not convex: a stationary point need not be a minimum"
            )
        if not problem.taken_as_convex:
            return "the program is not said to be convex, so that a stationary point need not be a minimum"
        return f"no constraint qualification is known: {qualification.of_program(problem)}"

    def obstacle(self, problem: NLP) -> str | None:
        """Return why the KKT system is neither necessary nor sufficient here: a minimum may have no multipliers, and
        a point with multipliers may be no minimum; else None.
        """
        why = "" if problem.taken_as_convex or self.qualified else qualification.of_program(problem)
        if not why:
            return None
        return f"{why}, so that a minimum may have no multipliers; where it has, use {self.name}[qualified=1]"

    def apply(self, problem: NLP) -> tuple[Problem, Trace]:
        self.require(problem)
        n, m, k = problem.start.size, problem.g.rows, problem.h.rows
        record = MapRecorder(n + m + k)
        z, lam, mu = np.split(record.z, [n, n + m])
        slope = record.transposed(problem.f, z, np.ones(problem.f.rows))
        slope = slope - record.transposed(problem.g, z, lam) - record.transposed(problem.h, z, mu)
        F = record.map(slope, record(problem.g, z), record(problem.h, z))
        fields: dict[str, Any] = {
            "F": F,
            "lb": np.concatenate([problem.lb, np.zeros(m), np.full(k, -np.inf)]),
            "ub": np.concatenate([problem.ub, np.full(m + k, np.inf)]),
            "start": np.concatenate([problem.start, np.zeros(m + k)]),
        }
        force = maps.kept(F.only(F.outputs[:n].tolist()))
        return formulations.get(self.target)(**fields), {
            "n": n,
            "m": m,
            "lb": problem.lb,
            "ub": problem.ub,
            "force": force,
        }

    def lift(self, point: MiCPPoint | GEPoint, trace: Trace) -> NLPPoint:
        """Return z, λ, μ, and ν: the force on z where a bound takes it, 0 where z is free to follow it.

        Of the force and the distance to the bound that it presses against, the smaller counts as 0.
        """
        n, m, lb, ub = trace["n"], trace["m"], trace["lb"], trace["ub"]
        x = point.z
        z = x[:n]
        with np.errstate(all="ignore"):
            force = maps.restored(trace["force"])(x)
            pressed = ((force > 0) & (force > z - lb)) | ((force < 0) & (-force > ub - z)) | (lb == ub)
        return NLPPoint(z=z, lam=x[n : n + m], mu=x[n + m :], nu=np.where(pressed, force, 0.0))

    def push(self, point: NLPPoint, trace: Trace) -> MiCPPoint | GEPoint:
        made: Any = formulations.get(self.target).point_type
        return made(z=np.concatenate([point.z, point.lam, point.mu]))


@edge("nlp-ge", equation="(29), (30)")
class NLPtoGE(ProgramConditions):
    """NLP → generalized equation by its optimality conditions (equations (29) and (30), the signs of g and h mended).

    Source  min f(z)  subject to  g(z) ≥ 0 (λ),  h(z) = 0 (μ),  lb ≤ z ≤ ub (ν, positive at lb).
    Target  0 ∈ F(x) + N_S(x),  x = (z, λ, μ),  F(x) = (∇f − ∇gᵀλ − ∇hᵀμ, g, h),  S = [lb, ub] × ℝ₊ × ℝ.
    Lift    z, λ, μ; ν is the part of F that belongs to z where a bound takes it.        Push  z, λ, μ.
    Kind    as of nlp-micp: equivalent, one-way or necessary, or refused.

    `qualified`: 1 says that the minima have multipliers. Trace: as of nlp-micp.
    """


@edge("nlp-micp", equation="(12)")
class NLPtoMiCP(ProgramConditions):
    """NLP → MiCP by its optimality conditions, Karush–Kuhn–Tucker (equation (12)).

    Source  min f(z)  subject to  g(z) ≥ 0 (λ),  h(z) = 0 (μ),  lb ≤ z ≤ ub (ν, positive at lb).
    Target  x = (z, λ, μ),  F(x) = (∇f − ∇gᵀλ − ∇hᵀμ, g, h),  lb ≤ z ≤ ub,  λ ≥ 0,  μ free. The bounds stay bounds.
    Lift    z, λ, μ; ν is the part of F that belongs to z where a bound takes it.        Push  z, λ, μ.
    Kind    of a convex program equivalent where a constraint qualification is known (`qualification`), one-way without:
            a minimum may have no multipliers then. Of another one necessary (stationary points), and refused where no
            qualification is known, which `qualified` overrules.

    `qualified`: 1 says that its minima have multipliers. Trace: `n`, `m`, `lb`, `ub`, and `force`, the map that says ν.
    """


@edge("nlp-qp", equation="(10) → (1)", kind=Kind.EQUIVALENT, cost=1.0)
class NLPtoQP(SameUnknowns):
    """NLP → QP, f quadratic, g and h affine (equations (10) and (1)).

    Source  min f(z)  subject to  g(z) = Az − b ≥ 0,  h(z) = Cz − d = 0,  lb ≤ z ≤ ub;  f(z) = f(0) + pᵀz + ½zᵀQz.
    Target  min ½zᵀQz + pᵀz  subject to  Az ≥ b,  Cz = d,  lb ≤ z ≤ ub; the number f(0) is left out.
    Lift    z, λ, μ, ν.        Push  the same.
    Kind    equivalent: the program is the same one.
    """

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
