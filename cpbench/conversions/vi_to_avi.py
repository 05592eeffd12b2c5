"""VI → AVI, F and g affine, K a box (equation (22)).

Source  −F(z) ∈ N_X(z),  F(z) = Mz + q,  X = {z ∈ K : lb ≤ z ≤ ub, Az ≥ b, Cz = d, g(z) ≥ 0},  g(z) = Ez − e.
Target  −(Mz + q) ∈ N_X(z) with the rows [A; E] z ≥ (b, e), Cz = d and the bounds of K among lb, ub.
Lift    z, λ and ν out of the multipliers of [A; E], μ.        Push  the same, backwards.
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions import maps, simple_sets
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.avi import AVI, AVIPoint
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.variational import VIPoint
from cpbench.formulations.vi import VI
from cpbench.foundation import matrices


@conversions.register("vi-avi")
@dataclass(frozen=True)
class VItoAVI(Conversion):
    """A VI without nonlinear terms, for solvers of linear ones. Trace: `m`, the number of rows of A."""

    name = "vi-avi"
    source = "vi"
    target = "avi"
    equation = "(22)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: VI) -> str | None:
        return (
            maps.curved(problem.F, "F") or maps.curved(problem.g, "g") or simple_sets.no_box(problem, "vi-ge or vi-cp")
        )

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
