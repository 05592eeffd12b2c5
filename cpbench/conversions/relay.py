"""Conversions of relay."""

from __future__ import annotations

from cpbench.conversions.base import SameUnknowns, edge
from cpbench.conversions.bounds import FromBounds
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.linear import AVI, Relay


@edge("relay-avi", equation="(22)", kind=Kind.EQUIVALENT, cost=1.0)
class RelayToAVI(SameUnknowns):
    """Relay → AVI: the box is a polyhedron.

    Source  −(Mz + q) ∈ N_[lb,ub](z).
    Target  the same, with no rows beside the bounds.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def apply(self, problem: Relay) -> tuple[AVI, Trace]:
        return AVI(M=problem.M, q=problem.q, lb=problem.lb, ub=problem.ub), {}


@edge("relay-lcp", equation="(22) → (13)", kind=Kind.EQUIVALENT, cost=1.0)
class RelayToLCP(FromBounds):
    """Relay → LCP with a multiplier for every upper bound.

    Source  −(Mz + q) ∈ N_[lb,ub](z), bounds finite.
    Target  z = lb + x:  0 ≤ x ⟂ Mx + y + q + M lb ≥ 0,  0 ≤ y ⟂ ub − lb − x ≥ 0;  matrix [[M, I], [−I, 0]].
            A variable whose ub is nearer to 0 is turned round, z = ub − x, which loses no digits to a far lb.
    Lift    z = lb + x.        Push  x = z − lb,  y = max(−(Mz + q), 0).
    Kind    equivalent. M + Mᵀ positive semidefinite stays so.

    Trace: see `bounds`.
    """
