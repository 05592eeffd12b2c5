"""First-order conditions as maps, with multipliers among the unknowns: what edges out of `nlp` and `vi` share.

Of a program, F(z, λ, μ) = (∇f − ∇gᵀλ − ∇hᵀμ, g, h); of a VI, F(z, λ, μ, ν) = (F − Aᵀλ − Cᵀμ − ∇gᵀν, Az − b,
Cz − d, g). Beside z with its own set, inequalities have multipliers ≥ 0 and equalities free ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cpbench.conversions import maps, qualification
from cpbench.conversions.base import Conversion
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.recording import MapRecorder, product
from cpbench.formulations.nlp import NLP, Convexity, NLPPoint
from cpbench.formulations.variational import VIPoint
from cpbench.formulations.vi import VI
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector

# ------------------------------------------------------------------------------------------- programs


def program_conditions(problem: NLP) -> tuple[Map, Vector, Vector, Vector, Trace]:
    """Return F, lb, ub, start, and what lifting needs: sizes, bounds, and the rows of F that say ν."""
    n, m, k = problem.start.size, problem.g.rows, problem.h.rows
    record = MapRecorder(n + m + k)
    z, lam, mu = np.split(record.z, [n, n + m])
    slope = record.transposed(problem.f, z, np.ones(problem.f.rows))
    slope = slope - record.transposed(problem.g, z, lam) - record.transposed(problem.h, z, mu)
    F = record.map(slope, record(problem.g, z), record(problem.h, z))
    lb = np.concatenate([problem.lb, np.zeros(m), np.full(k, -np.inf)])
    ub = np.concatenate([problem.ub, np.full(m + k, np.inf)])
    force = maps.kept(F.only(F.outputs[:n].tolist()))
    trace: Trace = {"n": n, "m": m, "lb": problem.lb, "ub": problem.ub, "force": force}
    return F, lb, ub, np.concatenate([problem.start, np.zeros(m + k)]), trace


def program_point(x: Vector, trace: Trace) -> NLPPoint:
    """Return z, λ, μ, and ν: the force on z where a bound takes it, 0 where z is free to follow it.

    Of the force and the distance to the bound that it presses against, the smaller counts as 0.
    """
    n, m, lb, ub = trace["n"], trace["m"], trace["lb"], trace["ub"]
    z = x[:n]
    with np.errstate(all="ignore"):
        force = maps.restored(trace["force"])(x)
        pressed = ((force > 0) & (force > z - lb)) | ((force < 0) & (-force > ub - z)) | (lb == ub)
    return NLPPoint(z=z, lam=x[n : n + m], mu=x[n + m :], nu=np.where(pressed, force, 0.0))


def program_vector(point: NLPPoint) -> Vector:
    return np.concatenate([point.z, point.lam, point.mu])


@dataclass(frozen=True)
class ProgramConditions(Conversion):
    """Base of the edges from a program to its conditions. `qualified`: 1 says that its minima have multipliers.

    Trace: `n`, `m`, `lb`, `ub`, and `force`, the map that gives ν.
    """

    source: ClassVar[str] = "nlp"
    kind: ClassVar[Kind] = Kind.NECESSARY
    best_kind = Kind.EQUIVALENT
    between: ClassVar[tuple[Kind, ...]] = (Kind.ONE_WAY,)
    cost: ClassVar[float] = 2.0

    qualified: int = 0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, NLP)
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


# -------------------------------------------------------------------------------------- inequalities


def inequality_conditions(problem: VI) -> tuple[Map, Vector, Vector]:
    """Return F, and the bounds of the multipliers (λ, μ, ν), of which none is bounded from above."""
    m, k, p = problem.b.size, problem.d.size, problem.g.rows
    if not m + k + p:
        return problem.F, np.zeros(0), np.zeros(0)
    n = problem.start.size
    record = MapRecorder(n + m + k + p)
    z, lam, mu, nu = np.split(record.z, np.cumsum([n, m, k]))
    A, C = matrices.sparse(problem.A), matrices.sparse(problem.C)
    force = record(problem.F, z) - product(A.T, lam) - product(C.T, mu) - record.transposed(problem.g, z, nu)
    rows = (product(A, z) - problem.b, product(C, z) - problem.d, record(problem.g, z))
    lb = np.concatenate([np.zeros(m), np.full(k, -np.inf), np.zeros(p)])
    return record.map(force, *rows), lb, np.full(m + k + p, np.inf)


def inequality_sizes(problem: VI) -> Trace:
    return {"n": problem.start.size, "m": problem.b.size, "k": problem.d.size}


def inequality_point(x: Vector, trace: Trace) -> VIPoint:
    z, lam, mu, nu = np.split(x, np.cumsum([trace["n"], trace["m"], trace["k"]]))
    return VIPoint(z=z, lam=lam, mu=mu, nu=nu)


def inequality_vector(point: VIPoint) -> Vector:
    return np.concatenate([point.z, point.lam, point.mu, point.nu])
