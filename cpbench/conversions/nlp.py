"""Conversions of nlp."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from cpbench.conversions import nonlinear, qualification
from cpbench.conversions.base import Conversion, SameUnknowns, edge
from cpbench.formulations.base import Kind, Problem, Trace, formulations
from cpbench.formulations.expressions.derivatives import has_constant_curvature
from cpbench.formulations.expressions.recording import MapRecorder
from cpbench.formulations.nonlinear import MiCPPoint
from cpbench.formulations.programs import NLP, QP, Convexity, NLPPoint
from cpbench.formulations.variational import GEPoint
from cpbench.foundation import matrices


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
        force = nonlinear.kept(F.only(F.outputs[:n].tolist()))
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
            force = nonlinear.restored(trace["force"])(x)
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
        why = nonlinear.curved(problem.g, "g") or nonlinear.curved(problem.h, "h")
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
