"""Global → local frictional contact: the Delassus operator (P_LM → P_L).

Source  Mv = Hr + f,  u = Hᵀv + w, contact law on (u, r),  M nonsingular.
Target  u = Wr + q,  W = HᵀM⁻¹H,  q = HᵀM⁻¹f + w, the same law, the same r.
Lift    v = M⁻¹(Hr + f).        Push  r.
Kind    equivalent, for nonsymmetric M too.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench import matrices
from cpbench.conversions import elimination
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.gfc import GlobalFrictionContact
from cpbench.formulations.global_contact import GFCPoint
from cpbench.matrices import Matrix


@conversions.register("gfc-fc")
@dataclass(frozen=True)
class GFCtoFC(Conversion):
    """Eliminate the velocities of the bodies. Trace: `factor` (M), `H`, `f`."""

    name = "gfc-fc"
    source = "gfc"
    target = "fc"
    equation = "P_LM → P_L"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: GlobalFrictionContact) -> str | None:
        instead = "no contact problem in r alone exists: take constrained or massless unknowns out of the model first"
        return elimination.singularity(problem.factorization, "the mass matrix M", instead)

    def apply(self, problem: GlobalFrictionContact) -> tuple[FrictionContact, Trace]:
        self.require(problem)
        factor = problem.factorization
        W = elimination.product(matrices.transpose(problem.H), factor, problem.H)
        if matrices.is_symmetric(problem.M):
            # W is symmetric but for rounding, which solvers that ask for symmetry would meet and refuse;
            # (x + y)/2 = (y + x)/2 in floating point too, so the mean is symmetric to the last bit
            W = elimination.compact(_mean_with_transpose(W))
        local = FrictionContact(W=W, q=problem.free_velocity, mu=problem.mu, dimension=problem.dimension)
        return local, {"factor": factor, "H": problem.H, "f": problem.f}

    def lift(self, point: FCPoint, trace: Trace) -> GFCPoint:
        return GFCPoint(v=trace["factor"].solve(trace["H"] @ point.r + trace["f"]), r=point.r)

    def push(self, point: GFCPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=point.r)


def _mean_with_transpose(W: Matrix) -> Matrix:
    return (W + matrices.transpose(W)) * 0.5
