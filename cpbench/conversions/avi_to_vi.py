"""AVI → VI (equation (22)).

Source  −(Mz + q) ∈ N_X(z),  X = {z : Az ≥ b, Cz = d, lb ≤ z ≤ ub}.
Target  −F(z) ∈ N_X(z),  F(z) = Mz + q.
Lift    z, λ, μ.        Push  the same.
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import kkt, maps
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.avi import AVI, AVIPoint
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.variational import VIPoint
from cpbench.formulations.vi import VI


@conversions.register("avi-vi")
@dataclass(frozen=True)
class AVItoVI(Conversion):
    """An AVI for solvers of nonlinear ones. Trace: empty."""

    name = "avi-vi"
    source = "avi"
    target = "vi"
    equation = "(22)"
    kind = Kind.EQUIVALENT
    cost = 4.0

    def obstacle(self, problem: AVI) -> str | None:
        return maps.too_large(problem.M)

    def apply(self, problem: AVI) -> tuple[VI, Trace]:
        self.require(problem)
        return VI(F=maps.affine(problem.M, problem.q), **kkt.polyhedron(problem)), {}

    def lift(self, point: VIPoint, trace: Trace) -> AVIPoint:
        return AVIPoint(z=point.z, lam=point.lam, mu=point.mu)

    def push(self, point: AVIPoint, trace: Trace) -> VIPoint:
        return VIPoint(z=point.z, lam=point.lam, mu=point.mu)
