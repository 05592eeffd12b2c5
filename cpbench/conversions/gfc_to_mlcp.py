"""Frictionless global contact → MLCP (equation (40)).

Source  Mv = Hr + Gλ + f,  Gᵀv + b = 0,  u = Hᵀv + w,  μ = 0: r_T = 0,  0 ≤ r_N ⟂ u_N ≥ 0.
Target  (v, λ) free, complementary r_N:  A = [[M, −G], [Gᵀ, 0]],  C = [−H_N; 0],  D = [H_Nᵀ, 0],  B = 0,
        a = (−f, b),  b = w_N.
Lift    v, λ, r = (r_N, 0).        Push  the same, backwards.
Kind    equivalent. M may be singular. G and f are FCLIB's: the lecture's f has the opposite sign, and its G is Gᵀ here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.formulations.global_contact import GFCPoint
from cpbench.formulations.mlcp import MLCP, MLCPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix
from cpbench.foundation.plurals import counted


@conversions.register("gfc-mlcp")
@dataclass(frozen=True)
class GFCtoMLCP(Conversion):
    """Contact without friction. Trace: `n` (velocities), `d` (rows of a contact)."""

    name = "gfc-mlcp"
    source = "gfc"
    target = "mlcp"
    equation = "(40)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: GlobalFrictionContact) -> str | None:
        rubbing = np.flatnonzero(problem.mu)
        if not rubbing.size:
            return None
        c = int(rubbing[0])
        return (
            f"friction at {counted(rubbing.size, 'contact')}, the first is {c} with μ = {problem.mu[c]:g}; use gfc-fc"
        )

    def apply(self, problem: GlobalFrictionContact) -> tuple[MLCP, Trace]:
        self.require(problem)
        M, G, d, nc, p = problem.M, problem.G, problem.dimension, problem.nc, problem.b.size
        H_N: Matrix = problem.H[:, ::d]
        target = MLCP(
            A=matrices.block([[M, -G], [matrices.transpose(G), matrices.zeros(p, p, M)]]),
            B=matrices.zeros(nc, nc, M),
            C=matrices.block([[-H_N], [matrices.zeros(p, nc, M)]]),
            D=matrices.block([[matrices.transpose(H_N), matrices.zeros(nc, p, M)]]),
            a=np.concatenate([-problem.f, problem.b]),
            b=problem.w[::d],
        )
        return target, {"n": problem.f.size, "d": d}

    def lift(self, point: MLCPPoint, trace: Trace) -> GFCPoint:
        r = np.zeros(point.v.size * trace["d"])
        r[:: trace["d"]] = point.v
        return GFCPoint(v=point.u[: trace["n"]], r=r, lam=point.u[trace["n"] :])

    def push(self, point: GFCPoint, trace: Trace) -> MLCPPoint:
        return MLCPPoint(u=np.concatenate([point.v, point.lam]), v=point.r[:: trace["d"]])
