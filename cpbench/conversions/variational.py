"""Conversions of variational inequalities: vi, qvi and ge."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from cpbench.conversions import maps, qualification
from cpbench.conversions.base import Conversion, SameUnknowns, edge
from cpbench.formulations.base import Kind, Trace, formulations
from cpbench.formulations.conic import CP, cone_fields
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.recording import MapRecorder, product
from cpbench.formulations.linear import AVI, AVIPoint
from cpbench.formulations.nonlinear import Equation, MiCP, MiCPPoint
from cpbench.formulations.variational import GE, QVI, VI, GEPoint, QVIPoint, VIPoint
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone
from cpbench.foundation.matrices import Vector


@edge("vi-avi", equation="(22)", kind=Kind.EQUIVALENT, cost=1.0)
class VItoAVI(Conversion):
    """VI → AVI, F and g affine, K a box (equation (22)).

    Source  −F(z) ∈ N_X(z),  F(z) = Mz + q,  X = {z ∈ K : lb ≤ z ≤ ub, Az ≥ b, Cz = d, g(z) ≥ 0},  g(z) = Ez − e.
    Target  −(Mz + q) ∈ N_X(z) with the rows [A; E] z ≥ (b, e), Cz = d and the bounds of K among lb, ub.
    Lift    z, λ and ν out of the multipliers of [A; E], μ.        Push  the same, backwards.
    Kind    equivalent.

    Trace: `m`, the number of rows of A.
    """

    def obstacle(self, problem: VI) -> str | None:
        return maps.curved(problem.F, "F") or maps.curved(problem.g, "g") or maps.no_box(problem, "vi-ge or vi-cp")

    def apply(self, problem: VI) -> tuple[AVI, Trace]:
        self.require(problem)
        F, g = problem.F.compiled, problem.g.compiled
        lb, ub = problem.box
        target = AVI(
            M=F.M,
            q=F.q,
            A=matrices.block([[problem.A], [g.M]]),
            b=np.concatenate([problem.b, -g.q]),
            C=problem.C,
            d=problem.d,
            lb=lb,
            ub=ub,
        )
        return target, {"m": problem.b.size}

    def lift(self, point: AVIPoint, trace: Trace) -> VIPoint:
        m = trace["m"]
        return VIPoint(z=point.z, lam=point.lam[:m], mu=point.mu, nu=point.lam[m:])

    def push(self, point: VIPoint, trace: Trace) -> AVIPoint:
        return AVIPoint(z=point.z, lam=np.concatenate([point.lam, point.nu]), mu=point.mu)


@edge("vi-cp", equation="(22) → (17)", kind=Kind.EQUIVALENT, cost=1.0)
class VItoCP(SameUnknowns):
    """VI → cone complementarity problem, X a cone (equations (22) and (17)).

    Source  −F(z) ∈ N_X(z),  X = {z ∈ K : Az ≥ 0, and bounds that are 0}, K a product of cones.
    Target  C ∋ x ⟂ F(x) ∈ C*,  C = {x ∈ K′ : Ax ≥ 0}; K′ is K with {0} and ℝ₊ for the components with bounds.
    Lift    z = x, λ.        Push  x = z, λ.
    Kind    equivalent: with y = 0 and y = 2z in the inequality, F(z)ᵀz = 0, and then F(z)ᵀy ≥ 0 on X.
    """

    renamed = {"z": "x"}

    def obstacle(self, problem: VI) -> str | None:
        if problem.g.rows or problem.d.size:
            return f"X has {problem.g.rows} rows g(z) ≥ 0 and {problem.d.size} rows Cz = d; use vi-ge"
        if problem.b.any():
            return f"the rows Az ≥ b have max|b| = {abs(problem.b).max():.1e}, so that X is not a cone; use vi-ge"
        why = maps.no_cone(problem)
        return f"{why}; use vi-ge" if why else None

    def apply(self, problem: VI) -> tuple[CP, Trace]:
        self.require(problem)
        K = cone_fields(maps.as_cone(problem))
        return CP(F=problem.F, A=problem.A, start=problem.start, **K), {}  # pyright: ignore[reportArgumentType]


@edge("vi-equation", equation="(22) → (31)", kind=Kind.EQUIVALENT, cost=1.0)
class VItoEquation(SameUnknowns):
    """VI → equations, X = ℝⁿ (equations (22) and (31)).

    Source  F(z)ᵀ(y − z) ≥ 0 for all y ∈ ℝⁿ.
    Target  F(z) = 0.
    Lift    z.        Push  z.
    Kind    equivalent: y = z − F(z) in the inequality gives F(z) = 0.
    """

    def obstacle(self, problem: VI) -> str | None:
        rows = problem.b.size + problem.d.size + problem.g.rows
        bounds = int((np.isfinite(problem.lb) | np.isfinite(problem.ub)).sum())
        factors = int((problem.K.kind != Cone.FREE).sum())
        if not (rows or bounds or factors):
            return None
        return (
            f"X is not ℝⁿ: {bounds} components with bounds, {factors} factors that are not ℝ, {rows} rows; use vi-micp"
        )

    def apply(self, problem: VI) -> tuple[Equation, Trace]:
        self.require(problem)
        return Equation(F=problem.F, start=problem.start), {}


def conditions(problem: VI) -> tuple[Map, Vector, Vector]:
    """Return F(z, λ, μ, ν) = (F − Aᵀλ − Cᵀμ − ∇gᵀν, Az − b, Cz − d, g), and the bounds of the multipliers (λ, μ, ν), of
    which none is bounded from above."""
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


class SetConditions(Conversion):
    """Base of the edges that make multipliers unknowns. Trace: `n`, `m`, `k`, the sizes of z, λ and μ."""

    kind: ClassVar[Kind] = Kind.ONE_WAY
    best_kind = Kind.EQUIVALENT

    def unqualified(self, problem: VI) -> str:
        """Return why no constraint qualification is known; empty where one is."""
        return qualification.of_set(problem)

    def exactness(self, problem: VI) -> Kind:
        return self.kind if self.unqualified(problem) else self.best_kind

    def reservation(self, problem: VI) -> str:
        return f"no constraint qualification of X is known: {self.unqualified(problem)}"

    def conditions(self, problem: VI, lb: Vector, ub: Vector) -> tuple[dict[str, Any], Trace]:
        """Return the fields F, lb, ub and start of the target, whose z has these bounds, and the trace."""
        F, least, most = conditions(problem)
        fields = {
            "F": F,
            "lb": np.concatenate([lb, least]),
            "ub": np.concatenate([ub, most]),
            "start": np.concatenate([problem.start, np.zeros(least.size)]),
        }
        return fields, {"n": problem.start.size, "m": problem.b.size, "k": problem.d.size}

    def lift(self, point: GEPoint | MiCPPoint, trace: Trace) -> VIPoint:
        z, lam, mu, nu = np.split(point.z, np.cumsum([trace["n"], trace["m"], trace["k"]]))
        return VIPoint(z=z, lam=lam, mu=mu, nu=nu)

    def push(self, point: VIPoint, trace: Trace) -> GEPoint | MiCPPoint:
        made: Any = formulations.get(self.target).point_type
        return made(z=np.concatenate([point.z, point.lam, point.mu, point.nu]))


@edge("vi-ge", equation="(24)", cost=1.0)
class VItoGE(SetConditions):
    """VI → generalized equation: a simple set as it is, rows by multipliers (equations (22), (24) and (27)).

    Source  −F(z) ∈ N_X(z),  X = {z ∈ S : Az ≥ b, Cz = d, g(z) ≥ 0},  S = {z ∈ K : lb ≤ z ≤ ub}.
    Target  0 ∈ (F − Aᵀλ − Cᵀμ − ∇gᵀν, Az − b, Cz − d, g) + N(z, λ, μ, ν) over S × ℝ₊ × ℝ × ℝ₊; F itself without rows.
    Lift    z, λ, μ, ν.        Push  the same.
    Kind    equivalent where there are no rows, or K is a box and a qualification is known as for vi-micp; one-way
            otherwise: the normal cone of X may be more than that of S and those of the rows together.

    Trace: `n`, `m`, `k`, the sizes of z, λ and μ.
    """

    def unqualified(self, problem: VI) -> str:
        rows = problem.b.size + problem.d.size + problem.g.rows
        if rows and not problem.only_box:
            return f"K is no box, and there are {rows} rows"
        return qualification.of_set(problem)

    def apply(self, problem: VI) -> tuple[GE, Trace]:
        fields, trace = self.conditions(problem, problem.lb, problem.ub)
        cones = {name: getattr(problem, name) for name in ("cone_kind", "cone_size", "cone_mu", "cone_mu_r")}
        if cones["cone_kind"].size:  # the multipliers are one more free factor, with their bounds
            last = {"cone_kind": float(Cone.FREE), "cone_size": float(fields["lb"].size - problem.lb.size)}
            cones = {name: np.append(value, last.get(name, 0.0)) for name, value in cones.items()}
        return GE(**fields, **cones), trace


@edge("vi-micp", equation="(22) → (20)", cost=2.0)
class VItoMiCP(SetConditions):
    """VI → MiCP: a box as it is, rows by multipliers (equations (22) and (20)).

    Source  −F(z) ∈ N_X(z),  X = {z ∈ K : lb ≤ z ≤ ub, Az ≥ b, Cz = d, g(z) ≥ 0}, K a product of {0}, ℝ and ℝ₊.
    Target  x = (z, λ, μ, ν),  (F − Aᵀλ − Cᵀμ − ∇gᵀν, Az − b, Cz − d, g),  z in its box,  λ ≥ 0,  μ free,  ν ≥ 0.
    Lift    z, λ, μ, ν, the parts of x.        Push  x = (z, λ, μ, ν).
    Kind    equivalent where the rows are affine, or g is concave and the start is Slater's point (`qualification`);
            for any other concave g one-way: a solution may have no multipliers.

    Trace: `n`, `m`, `k`, the sizes of z, λ and μ.
    """

    def obstacle(self, problem: VI) -> str | None:
        return maps.no_box(problem, "vi-ge")

    def apply(self, problem: VI) -> tuple[MiCP, Trace]:
        self.require(problem)
        fields, trace = self.conditions(problem, *problem.box)
        return MiCP(**fields), trace


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
        return maps.no_box(problem, "newton-qvi on the problem itself")

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
        return target, {**sizes, "lb": lb, "ub": ub, "map": maps.kept(F)}

    def lift(self, point: MiCPPoint, trace: Trace) -> QVIPoint:
        n, low, up = trace["n"], trace["low"], trace["up"]
        return QVIPoint(z=point.z[:n], nu=point.z[n + low + up :])

    def push(self, point: QVIPoint, trace: Trace) -> MiCPPoint:
        n, low, up = trace["n"], trace["low"], trace["up"]
        z, nothing = point.z, np.zeros(low + up)
        values = maps.restored(trace["map"])(np.concatenate([z, nothing, point.nu]))
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


@edge("ge-avi", equation="(27) → (22)", kind=Kind.EQUIVALENT, cost=1.0)
class GEtoAVI(SameUnknowns):
    """Generalized equation → AVI over a box, F affine (equations (27) and (22)).

    Source  0 ∈ F(z) + N_S(z),  F(z) = Mz + q,  S = {z ∈ K : lb ≤ z ≤ ub}, K a product of {0}, ℝ and ℝ₊.
    Target  −(Mz + q) ∈ N_X(z), X the box with the bounds of S.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def obstacle(self, problem: GE) -> str | None:
        return maps.curved(problem.F, "F") or maps.no_box(problem, "ge-vi")

    def apply(self, problem: GE) -> tuple[AVI, Trace]:
        self.require(problem)
        F = problem.F.compiled
        lb, ub = problem.box
        return AVI(M=F.M, q=F.q, lb=lb, ub=ub), {}


@edge("ge-micp", equation="(27) → (21)", kind=Kind.EQUIVALENT, cost=1.0)
class GEtoMiCP(SameUnknowns):
    """Generalized equation → MiCP, S a box (equations (27) and (21)).

    Source  0 ∈ F(z) + N_S(z),  S = {z ∈ K : lb ≤ z ≤ ub}, K a product of {0}, ℝ and ℝ₊.
    Target  the MiCP of F with the bounds of S: 0 and 0 for a factor {0}, 0 and ∞ for ℝ₊.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def obstacle(self, problem: GE) -> str | None:
        return maps.no_box(problem, "ge-vi")

    def apply(self, problem: GE) -> tuple[MiCP, Trace]:
        self.require(problem)
        lb, ub = problem.box
        return MiCP(F=problem.F, lb=lb, ub=ub, start=problem.start), {}


@edge("ge-vi", equation="(27) → (22)", kind=Kind.EQUIVALENT, cost=1.0)
class GEtoVI(SameUnknowns):
    """Generalized equation → VI (equations (24) and (27)).

    Source  0 ∈ F(z) + N_S(z),  S = {z ∈ K : lb ≤ z ≤ ub}.
    Target  F(z)ᵀ(y − z) ≥ 0 for all y ∈ S.
    Lift    z.        Push  z.
    Kind    equivalent: that is what a normal cone is.
    """

    def apply(self, problem: GE) -> tuple[VI, Trace]:
        return VI(F=problem.F, **problem.data()), {}  # pyright: ignore[reportArgumentType]
