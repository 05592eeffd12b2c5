"""Generalized equation → AVI over a box, F affine (equations (27) and (22)).

Source  0 ∈ F(z) + N_S(z),  F(z) = Mz + q,  S = {z ∈ K : lb ≤ z ≤ ub}, K a product of {0}, ℝ and ℝ₊.
Target  −(Mz + q) ∈ N_X(z), X the box with the bounds of S.
Lift    z.        Push  z.
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import maps, simple_sets
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.avi import AVI, AVIPoint
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.ge import GE, GEPoint


@conversions.register("ge-avi")
@dataclass(frozen=True)
class GEtoAVI(Conversion):
    """An inclusion without nonlinear terms, for solvers of linear ones. Trace: empty."""

    name = "ge-avi"
    source = "ge"
    target = "avi"
    equation = "(27) → (22)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: GE) -> str | None:
        return maps.curved(problem.F, "F") or simple_sets.no_box(problem, "ge-vi")

    def apply(self, problem: GE) -> tuple[AVI, Trace]:
        self.require(problem)
        F = problem.F.compiled
        lb, ub = problem.box
        return AVI(M=F.M, q=F.q, lb=lb, ub=ub), {}

    def lift(self, point: AVIPoint, trace: Trace) -> GEPoint:
        return GEPoint(z=point.z)

    def push(self, point: GEPoint, trace: Trace) -> AVIPoint:
        return AVIPoint(z=point.z)
