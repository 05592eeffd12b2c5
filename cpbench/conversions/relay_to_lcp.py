"""Relay → LCP with a multiplier for every upper bound.

Source  −(Mz + q) ∈ N_[lb,ub](z), bounds finite.
Target  z = lb + x:  0 ≤ x ⟂ Mx + y + q + M lb ≥ 0,  0 ≤ y ⟂ ub − lb − x ≥ 0;  matrix [[M, I], [−I, 0]].
        A variable whose ub is nearer to 0 is turned round, z = ub − x, which loses no digits to a far lb.
Lift    z = lb + x.        Push  x = z − lb,  y = max(−(Mz + q), 0).
Kind    equivalent. M + Mᵀ positive semidefinite stays so.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import bounds
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.formulations.relay import Relay


@conversions.register("relay-lcp")
@dataclass(frozen=True)
class RelayToLCP(Conversion):
    """2n complementary variables. Trace: see `bounds`."""

    name = "relay-lcp"
    source = "relay"
    target = "lcp"
    equation = "(22) → (13)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: Relay) -> str | None:
        return bounds.obstacle(problem.M, problem.q, problem.lb, problem.ub)

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for more, for the terms that cancel on the way back (see `shift`)."""
        return tolerance / trace["shift"]

    def apply(self, problem: Relay) -> tuple[LCP, Trace]:
        self.require(problem)
        return bounds.to_lcp(problem.M, problem.q, problem.lb, problem.ub)

    def lift(self, point: LCPPoint, trace: Trace) -> LCPPoint:
        return LCPPoint(z=bounds.lift(point, trace))

    def push(self, point: LCPPoint, trace: Trace) -> LCPPoint:
        return bounds.push(point.z, trace)
