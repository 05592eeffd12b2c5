"""Cone complementarity problem → cone LCP, F affine and no rows (equation (17)).

Source  K ∋ x ⟂ F(x) ∈ K*,  F(x) = Mx + q.
Target  K ∋ x ⟂ Mx + q ∈ K*.
Lift    x.        Push  x.
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions import maps
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.conic import cone_fields
from cpbench.formulations.cp import CP, CPPoint
from cpbench.formulations.soclcp import SOCLCP, SOCLCPPoint


@conversions.register("cp-soclcp")
@dataclass(frozen=True)
class CPtoSOCLCP(Conversion):
    """A cone complementarity problem without nonlinear terms. Trace: empty."""

    name = "cp-soclcp"
    source = "cp"
    target = "soclcp"
    equation = "(17)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: CP) -> str | None:
        if problem.A.shape[0]:
            return f"the cone has {problem.A.shape[0]} rows Ax ≥ 0 beside its factors; use cp-vi"
        return maps.curved(problem.F, "F")

    def apply(self, problem: CP) -> tuple[SOCLCP, Trace]:
        self.require(problem)
        F = problem.F.compiled
        return SOCLCP(M=F.M, q=F.q, **cone_fields(problem.K)), {}  # pyright: ignore[reportArgumentType]

    def lift(self, point: SOCLCPPoint, trace: Trace) -> CPPoint:
        return CPPoint(x=point.x, lam=np.zeros(0))

    def push(self, point: CPPoint, trace: Trace) -> SOCLCPPoint:
        return SOCLCPPoint(x=point.x)
