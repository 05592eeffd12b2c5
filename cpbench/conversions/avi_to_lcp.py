"""AVI over a box → LCP; bounds may be missing on one side.

Source  −(Mz + q) ∈ N_[lb,ub](z), every variable bounded on one side at least, no rows beside.
Target  z = c + Sx, c the bound nearer to 0, S = 1 for lb and −1 for ub; y ≥ 0 where both bounds are finite:
        0 ≤ x ⟂ SMSx + Jᵀy + S(q + Mc) ≥ 0,  0 ≤ y ⟂ ub − lb − Jx ≥ 0.
Lift    z = c + Sx.        Push  x = S(z − c),  y = max(−S(Mz + q), 0).
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions import bounds
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.avi import AVI, AVIPoint
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.lcp import LCP, LCPPoint


@conversions.register("avi-lcp-bounds")
@dataclass(frozen=True)
class AVItoLCPBounds(Conversion):
    """Bounds as complementary variables. Trace: see `bounds`."""

    name = "avi-lcp-bounds"
    source = "avi"
    target = "lcp"
    equation = "(22) → (13)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: AVI) -> str | None:
        if not problem.only_box:
            rows = problem.b.size + problem.d.size
            return f"the set has {rows} rows beside its bounds; use avi-mlcp"
        free = np.flatnonzero(np.isinf(problem.lb) & np.isinf(problem.ub))
        if free.size:
            return f"{free.size} variables have no bound, the first is {free[0]}; use avi-mlcp"
        return bounds.obstacle(problem.M, problem.q, problem.lb, problem.ub)

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for more, for the terms that cancel on the way back (see `shift`)."""
        return tolerance / trace["shift"]

    def apply(self, problem: AVI) -> tuple[LCP, Trace]:
        self.require(problem)
        return bounds.to_lcp(problem.M, problem.q, problem.lb, problem.ub)

    def lift(self, point: LCPPoint, trace: Trace) -> AVIPoint:
        return AVIPoint(z=bounds.lift(point, trace))

    def push(self, point: AVIPoint, trace: Trace) -> LCPPoint:
        return bounds.push(point.z, trace)
