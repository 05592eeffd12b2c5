"""Conversions of qvi."""

from __future__ import annotations

import numpy as np

from cpbench.conversions import nonlinear
from cpbench.conversions.base import Conversion, edge
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.recording import MapRecorder
from cpbench.formulations.nonlinear import MiCP, MiCPPoint
from cpbench.formulations.variational import QVI, QVIPoint


@edge("qvi-micp", equation="(22) with X(z) → (20)", kind=Kind.ONE_WAY, cost=2.0)
class QVItoMiCP(Conversion):
    """QVI → MiCP: rows and moving bounds by multipliers (equations (22) with X(z) and (20)).

    Source  −F(z) ∈ N_X(z)(z),  X(z) = {y ∈ K : lb ≤ y ≤ ub, lower(z) ≤ y ≤ upper(z), g(y, z) ≥ 0}, K of {0}, ℝ and ℝ₊.
    Target  x = (z, λ, κ, ν),  (F − λ + κ − ∇_y g(z, z)ᵀν, z − lower(z), upper(z) − z, g(z, z)),  z in its box,
            λ, κ, ν ≥ 0.
    Lift    z, ν, the parts of x.        Push  λ and κ are the force on z where a moving bound is the tighter one.
    Kind    equivalent where g is affine; for any other g that is concave in y one-way: a solution may have no
            multipliers. So a generalized Nash game is solved by the conditions of all players at once.

    Trace: `n`, `low`, `up`, the sizes of z, λ and κ; lb, ub; the target's `map`.
    """

    best_kind = Kind.EQUIVALENT

    def exactness(self, problem: QVI) -> Kind:
        return self.best_kind if problem.g.compiled.affine else self.kind

    def reservation(self, problem: QVI) -> str:
        curved = int((np.diff(problem.g.compiled.C.indptr) > 0).sum())
        return f"{curved} rows of g are not affine, for which no constraint qualification is known"

    def obstacle(self, problem: QVI) -> str | None:
        return nonlinear.no_box(problem, "newton-qvi on the problem itself")

    def apply(self, problem: QVI) -> tuple[MiCP, Trace]:
        self.require(problem)
        n, (lb, ub) = problem.start.size, problem.box
        F = _conditions(problem)
        more = F.inputs - n
        target = MiCP(
            F=F,
            lb=np.concatenate([lb, np.zeros(more)]),
            ub=np.concatenate([ub, np.full(more, np.inf)]),
            start=np.concatenate([problem.start, np.zeros(more)]),
        )
        sizes = {"n": n, "low": problem.lower.rows, "up": problem.upper.rows}
        return target, {**sizes, "lb": lb, "ub": ub, "map": nonlinear.kept(F)}

    def lift(self, point: MiCPPoint, trace: Trace) -> QVIPoint:
        n, low, up = trace["n"], trace["low"], trace["up"]
        return QVIPoint(z=point.z[:n], nu=point.z[n + low + up :])

    def push(self, point: QVIPoint, trace: Trace) -> MiCPPoint:
        n, low, up = trace["n"], trace["low"], trace["up"]
        z, nothing = point.z, np.zeros(low + up)
        values = nonlinear.restored(trace["map"])(np.concatenate([z, nothing, point.nu]))
        force, above, below = values[:n], values[n : n + low], values[n + low : n + low + up]
        lam = np.where(z - above >= trace["lb"], np.maximum(force, 0.0), 0.0) if low else above
        kappa = np.where(z + below <= trace["ub"], np.maximum(-force, 0.0), 0.0) if up else below
        return MiCPPoint(z=np.concatenate([z, lam, kappa, point.nu]))


def _conditions(problem: QVI) -> Map:
    """Return F(z, λ, κ, ν) of the target."""
    n, low, up, p = problem.start.size, problem.lower.rows, problem.upper.rows, problem.g.rows
    record = MapRecorder(n + low + up + p)
    z, lam, kappa, nu = np.split(record.z, np.cumsum([n, low, up]))
    force, rows = record(problem.F, z), []
    if low:
        force = force - lam
        rows.append(z - record(problem.lower, z))
    if up:
        force = force + kappa
        rows.append(record(problem.upper, z) - z)
    if p:
        both = np.concatenate([z, z])
        force = force - record.transposed(problem.g, both, nu)[:n]
        rows.append(record(problem.g, both))
    return record.map(force, *rows)
