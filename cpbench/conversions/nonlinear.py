"""Conversions of problems with a nonlinear map: ncp and micp."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import numpy as np
import scipy.sparse as sp

from cpbench.conversions import bounds, maps
from cpbench.conversions.base import Conversion, SameUnknowns, edge
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.recording import MapRecorder, maximum, minimum
from cpbench.formulations.linear import AVI, LCP, MLCP, MLCPPoint
from cpbench.formulations.ncp_functions import symbolic_fischer_burmeister
from cpbench.formulations.nonlinear import NCP, Equation, EquationPoint, MiCP, MiCPPoint
from cpbench.formulations.variational import VI
from cpbench.foundation import matrices
from cpbench.foundation.cones import project_box
from cpbench.foundation.matrices import Matrix, Vector


@edge("ncp-lcp", equation="(19) → (13)", kind=Kind.EQUIVALENT, cost=1.0)
class NCPtoLCP(SameUnknowns):
    """NCP → LCP, F affine (equations (19) and (13)).

    Source  0 ≤ z ⟂ F(z) ≥ 0,  F(z) = Mz + q.
    Target  0 ≤ z ⟂ Mz + q ≥ 0.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def obstacle(self, problem: NCP) -> str | None:
        return maps.curved(problem.F, "F")

    def apply(self, problem: NCP) -> tuple[LCP, Trace]:
        self.require(problem)
        F = problem.F.compiled
        return LCP(M=F.M, q=F.q), {}


@edge("ncp-micp", equation="(19) → (21)", kind=Kind.EQUIVALENT, cost=1.0)
class NCPtoMiCP(SameUnknowns):
    """NCP → MiCP, all of it complementary (equations (19) to (21)).

    Source  0 ≤ z ⟂ F(z) ≥ 0.
    Target  the MiCP of F with lb = 0, ub = ∞.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def apply(self, problem: NCP) -> tuple[MiCP, Trace]:
        n = problem.start.size
        return MiCP(F=problem.F, lb=np.zeros(n), ub=np.full(n, np.inf), start=problem.start), {}


TSENG = (2.0 - 2.0**0.5) / (2.0 + 2.0**0.5)
"""How much smaller φ may be beside its scale than min(a, b) beside its own, for Fischer and Burmeister's φ:
(2 − √2)|min(a, b)| ≤ |φ(a, b)| ≤ (2 + √2)|min(a, b)| (Tseng, J. Optimization Theory and Applications 89, 1996)."""

Function: TypeAlias = Callable[[Any, Any], Any]
"""φ of two columns of symbols."""


def equations(problem: MiCP, phi: Function) -> Map:
    """Return Φ of an NCP function φ, zero exactly where 0 ≤ a ⟂ b ≥ 0: the equations Φ(z) = 0 that it makes of a MiCP.

    All have the sign of min(a, b): the lecture's (36) and (37) are −φ. Then Φᵢ is

        Fᵢ                                          where zᵢ is free,
        φ(zᵢ − lbᵢ, Fᵢ)                             with a lower bound,      −φ(ubᵢ − zᵢ, −Fᵢ)    with an upper one,
        φ(zᵢ − lbᵢ, −φ(ubᵢ − zᵢ, −Fᵢ))              with both (Billups, "Algorithms for complementarity problems and
                                                    generalized equations", thesis, Wisconsin 1995), and
        zᵢ − lbᵢ                                    where the two are the same.

    For φ = min the third is the median of zᵢ − lbᵢ, zᵢ − ubᵢ and Fᵢ, so that Φ is the natural map z − P(z − F(z)).
    """
    record = MapRecorder(problem.start.size)
    z, lb, ub = record.z, problem.lb, problem.ub
    F = record(problem.F, z)
    below, above = np.isfinite(lb), np.isfinite(ub)
    result = z.copy()
    for members, make in (
        (~below & ~above, lambda x, w, lo, up: w),
        (below & ~above, lambda x, w, lo, up: phi(x - lo, w)),
        (~below & above, lambda x, w, lo, up: -phi(up - x, -w)),
        (below & above & (lb < ub), lambda x, w, lo, up: phi(x - lo, -phi(up - x, -w))),
        (below & above & (lb == ub), lambda x, w, lo, up: x - lo),
    ):
        at = np.flatnonzero(members)
        if at.size:
            result[at] = make(z[at], F[at], lb[at], ub[at])
    return record.map(result)


@dataclass(frozen=True)
class MiCPtoEquation(SameUnknowns):
    """Base of the edges by an NCP function, their `function`."""

    kind: ClassVar[Kind] = Kind.EQUIVALENT

    @abstractmethod
    def function(self, a: Any, b: Any) -> Any:
        """Return φ(a, b)."""

    def apply(self, problem: MiCP) -> tuple[Equation, Trace]:
        self.require(problem)
        return Equation(F=equations(problem, self.function), start=problem.start), {}


@edge("micp-avi", equation="(21) → (22)", kind=Kind.EQUIVALENT, cost=1.0)
class MiCPtoAVI(SameUnknowns):
    """MiCP → AVI over a box, F affine (equations (21) and (22)).

    Source  lb ≤ z ≤ ub, F(z) = Mz + q: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
    Target  −(Mz + q) ∈ N_X(z),  X = {lb ≤ z ≤ ub}.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def obstacle(self, problem: MiCP) -> str | None:
        return maps.curved(problem.F, "F")

    def apply(self, problem: MiCP) -> tuple[AVI, Trace]:
        self.require(problem)
        F = problem.F.compiled
        return AVI(M=F.M, q=F.q, lb=problem.lb, ub=problem.ub), {}


@edge("micp-equation-ep", equation="(38)", cost=2.4)
class MiCPtoEquationEP(MiCPtoEquation):
    """MiCP → smooth equations by Evtushenko and Purtov's function (equations (31) and (38), its sign mended).

    Source  lb ≤ z ≤ ub: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
    Target  Φ(z) = 0 with φ(a, b) = ab − ½ min(0, a + b)². (38) has a plus, which is also zero at a = −1, b = 2 − √3.
    Lift    z.        Push  z.
    Kind    equivalent. Φ is continuously differentiable, its Jacobian singular where a = b = 0: Φ = δ leaves min(a, b)
            between δ and √δ.
    """

    def function(self, a: Any, b: Any) -> Any:
        negative = minimum(a + b, 0.0)
        return a * b - 0.5 * negative * negative

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for ε²: a product of ε² may be that of two numbers of size ε."""
        return min(tolerance, tolerance**2)


@edge("micp-equation-fb", equation="(36)", cost=2.0)
class MiCPtoEquationFB(MiCPtoEquation):
    """MiCP → nonsmooth equations by Fischer and Burmeister's function (equations (31) and (36)).

    Source  lb ≤ z ≤ ub: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
    Target  Φ(z) = 0 with φ(a, b) = a + b − √(a² + b²), which is (36) with the other sign.
    Lift    z.        Push  z.
    Kind    equivalent. ½‖Φ‖² is continuously differentiable; Φ is not where a = b = 0.
    """

    def function(self, a: Any, b: Any) -> Any:
        return symbolic_fischer_burmeister(a, b)

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Apply Tseng's bounds, twice where a variable has two bounds. They hold where 0 is in the box: the scale of Φ
        is its size at 0, wherever the box is.
        """
        return TSENG**2 * tolerance


@edge("micp-equation-min", equation="(35)", cost=2.1)
class MiCPtoEquationMin(MiCPtoEquation):
    """MiCP → nonsmooth equations by the minimum (equations (31) and (35)).

    Source  lb ≤ z ≤ ub: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
    Target  Φ(z) = 0 with φ(a, b) = min(a, b): the natural map; the median of z − lb, z − ub and F with two bounds.
    Lift    z.        Push  z.
    Kind    equivalent. Φ is piecewise smooth, and ½‖Φ‖² is not differentiable.
    """

    def function(self, a: Any, b: Any) -> Any:
        return minimum(a, b)


@edge("micp-equation-normal", equation="(26)", kind=Kind.EQUIVALENT, cost=2.3)
class MiCPtoEquationNormal(Conversion):
    """MiCP → nonsmooth equations by the normal map (equations (26) and (31)).

    Source  lb ≤ z ≤ ub: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
    Target  F(P(x)) + x − P(x) = 0, P the projection on the box: it is zero at x = z − F(z), not at z.
    Lift    z = P(x).        Push  x = z − F(z).
    Kind    equivalent. F is asked for values in the box alone (Robinson, Mathematics of Operations Research 17, 1992).

    Trace: `lb`, `ub`, and `F` for `push`.
    """

    def apply(self, problem: MiCP) -> tuple[Equation, Trace]:
        record = MapRecorder(problem.start.size)
        x, z = record.z, record.z.copy()
        for side, clip in ((problem.lb, maximum), (problem.ub, minimum)):
            at = np.flatnonzero(np.isfinite(side))
            if at.size:
                z[at] = clip(z[at], side[at])
        target = Equation(F=record.map(record(problem.F, z) + x - z), start=problem.start)
        return target, {"lb": problem.lb, "ub": problem.ub, "F": maps.kept(problem.F)}

    def lift(self, point: EquationPoint, trace: Trace) -> MiCPPoint:
        return MiCPPoint(z=project_box(point.z, trace["lb"], trace["ub"]))

    def push(self, point: MiCPPoint, trace: Trace) -> EquationPoint:
        return EquationPoint(z=point.z - maps.restored(trace["F"])(point.z))


@edge("micp-equation-pfb", equation="(37)", cost=2.2)
class MiCPtoEquationPenalized(MiCPtoEquation):
    """MiCP → nonsmooth equations by the penalized Fischer–Burmeister function (equations (31) and (37)).

    Source  lb ≤ z ≤ ub: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
    Target  Φ(z) = 0 with φ(a, b) = λ(a + b − √(a² + b²)) + (1 − λ) max(0, a) max(0, b), 0 < λ < 1, which is (37) with
            the other sign (Chen, Chen and Kanzow, Mathematical Programming 88, 2000, who take λ = 0.95).
    Lift    z.        Push  z.
    Kind    equivalent.

    `share`: λ.
    """

    share: float = 0.95

    def obstacle(self, problem: MiCP) -> str | None:
        return None if 0.0 < self.share < 1.0 else f"share is {self.share:g}, expected a number between 0 and 1"

    def function(self, a: Any, b: Any) -> Any:
        penalty = maximum(a, 0.0) * maximum(b, 0.0)
        return self.share * symbolic_fischer_burmeister(a, b) + (1.0 - self.share) * penalty

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for as much as Fischer and Burmeister's φ, of which this is at least λ times as large."""
        return (TSENG * self.share) ** 2 * tolerance


@edge("micp-mlcp", equation="Josephy–Newton", kind=Kind.APPROXIMATE, cost=2.0)
class MiCPtoMLCP(Conversion):
    """MiCP → MLCP by linearization, one step of Josephy and Newton (MATH: A, B, C, D are blocks of F′).

    Source  lb ≤ z ≤ ub: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
    Target  the same with F(z_k) + F′(z_k)(z − z_k) in place of F(z). u are the free zᵢ; v = z − lb or ub − z from the
            bound nearer to 0, so z = c + Sx with x = (u, v); and with J the rows of the identity for variables of two
            bounds, one more y for each: 0 ≤ y ⟂ ub − lb − Jv ≥ 0.
    Lift    z = c + Sx.        Push  x = S(z − c), y = what holds z at its second bound.
    Kind    approximate: the solution of the source solves the target where z_k is that solution, and the error falls
            with the square of the distance of z_k to it. A step of a method, which no route takes unless it is named.

    `at`: z_k, the start of the problem if none is given. Trace: `free`, `bounded`, `both` (indices; the last among
    `bounded`), `c`, `S`, `M`, `q` of the linearization.
    """

    at: tuple[float, ...] = ()

    def obstacle(self, problem: MiCP) -> str | None:
        if self.at and len(self.at) != problem.start.size:
            return f"at has {len(self.at)} numbers, the problem has {problem.start.size} unknowns"
        z = self._point(problem)
        with np.errstate(all="ignore"):
            defined = np.isfinite(problem.F(z)).all() and np.isfinite(problem.F.jacobian(z).data).all()
        return None if defined else "F or its Jacobian is not finite at z_k; set another `at`"

    def _point(self, problem: MiCP) -> Vector:
        return project_box(np.array(self.at) if self.at else problem.start, problem.lb, problem.ub)

    def apply(self, problem: MiCP) -> tuple[MLCP, Trace]:
        self.require(problem)
        z, lb, ub = self._point(problem), problem.lb, problem.ub
        M = problem.F.jacobian(z)
        q = problem.F(z) - M @ z
        has_bound = np.isfinite(lb) | np.isfinite(ub)
        free, bounded = np.flatnonzero(~has_bound), np.flatnonzero(has_bound)
        both = np.flatnonzero((np.isfinite(lb) & np.isfinite(ub))[bounded])
        c, S = np.zeros(z.size), np.ones(z.size)
        c[bounded], S[bounded] = bounds.origin(lb[bounded], ub[bounded])
        scaled, shifted = matrices.sparse(matrices.scaled_both(M, S)), S * (q + M @ c)
        J = sp.csr_array((np.ones(both.size), (np.arange(both.size), both)), shape=(both.size, bounded.size))
        rows = bounded[both]
        target = MLCP(
            A=_part(scaled, free, free),
            B=matrices.block(
                [
                    [_part(scaled, bounded, bounded), matrices.transpose(J)],
                    [-J, matrices.zeros(both.size, both.size, J)],
                ]
            ),
            C=matrices.block([[_part(scaled, free, bounded), matrices.zeros(free.size, both.size, J)]]),
            D=matrices.block([[_part(scaled, bounded, free)], [matrices.zeros(both.size, free.size, J)]]),
            a=shifted[free],
            b=np.concatenate([shifted[bounded], ub[rows] - lb[rows]]),
        )
        return target, {"free": free, "bounded": bounded, "both": both, "c": c, "S": S, "M": M, "q": q}

    def lift(self, point: MLCPPoint, trace: Trace) -> MiCPPoint:
        z = np.array(trace["c"])
        bounded = trace["bounded"]
        z[trace["free"]] = point.u
        z[bounded] += trace["S"][bounded] * point.v[: bounded.size]
        return MiCPPoint(z=z)

    def push(self, point: MiCPPoint, trace: Trace) -> MLCPPoint:
        bounded, S = trace["bounded"], trace["S"]
        force = S * (trace["M"] @ point.z + trace["q"])
        y = np.maximum(-force[bounded][trace["both"]], 0.0)
        v = S[bounded] * (point.z - trace["c"])[bounded]
        return MLCPPoint(u=point.z[trace["free"]], v=np.concatenate([v, y]))


def _part(M: Matrix, rows: np.ndarray, columns: np.ndarray) -> Matrix:
    return sp.csr_array(matrices.sparse(M)[rows][:, columns])


@edge("micp-vi", equation="(21) → (22)", kind=Kind.EQUIVALENT, cost=1.0)
class MiCPtoVI(SameUnknowns):
    """MiCP → VI over a box (equations (21) and (22)).

    Source  lb ≤ z ≤ ub: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
    Target  F(z)ᵀ(y − z) ≥ 0 for all y ∈ X = {lb ≤ y ≤ ub}.
    Lift    z.        Push  z.
    Kind    equivalent: a box is a product of intervals, and the inequality is one of every component for itself.
    """

    def apply(self, problem: MiCP) -> tuple[VI, Trace]:
        return VI(F=problem.F, lb=problem.lb, ub=problem.ub, start=problem.start), {}
