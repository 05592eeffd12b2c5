"""MiCP → AVI over a box, F affine (equations (21) and (22)).

Source  lb ≤ z ≤ ub, F(z) = Mz + q: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
Target  −(Mz + q) ∈ N_X(z),  X = {lb ≤ z ≤ ub}.
Lift    z.        Push  z.
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import maps
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.avi import AVI, AVIPoint
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.micp import MiCP, MiCPPoint


@conversions.register("micp-avi")
@dataclass(frozen=True)
class MiCPtoAVI(Conversion):
    """A MiCP without nonlinear terms, for solvers of linear ones. Trace: empty."""

    name = "micp-avi"
    source = "micp"
    target = "avi"
    equation = "(21) → (22)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: MiCP) -> str | None:
        return maps.curved(problem.F, "F")

    def apply(self, problem: MiCP) -> tuple[AVI, Trace]:
        self.require(problem)
        F = problem.F.compiled
        return AVI(M=F.M, q=F.q, lb=problem.lb, ub=problem.ub), {}

    def lift(self, point: AVIPoint, trace: Trace) -> MiCPPoint:
        return MiCPPoint(z=point.z)

    def push(self, point: MiCPPoint, trace: Trace) -> AVIPoint:
        return AVIPoint(z=point.z)
