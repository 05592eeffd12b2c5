"""Conversions of ge."""

from __future__ import annotations

from cpbench.conversions import nonlinear
from cpbench.conversions.base import SameUnknowns, edge
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.linear import AVI
from cpbench.formulations.nonlinear import MiCP
from cpbench.formulations.variational import GE, VI


@edge("ge-avi", equation="(27) → (22)", kind=Kind.EQUIVALENT, cost=1.0)
class GEtoAVI(SameUnknowns):
    """Generalized equation → AVI over a box, F affine (equations (27) and (22)).

    Source  0 ∈ F(z) + N_S(z),  F(z) = Mz + q,  S = {z ∈ K : lb ≤ z ≤ ub}, K a product of {0}, ℝ and ℝ₊.
    Target  −(Mz + q) ∈ N_X(z), X the box with the bounds of S.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def obstacle(self, problem: GE) -> str | None:
        return nonlinear.curved(problem.F, "F") or nonlinear.no_box(problem, "ge-vi")

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
        return nonlinear.no_box(problem, "ge-vi")

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
