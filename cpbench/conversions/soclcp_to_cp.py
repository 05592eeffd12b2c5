"""Cone LCP → cone complementarity problem, the affine one (equation (17)).

Source  K ∋ x ⟂ Mx + q ∈ K*.
Target  K ∋ x ⟂ F(x) ∈ K*,  F(x) = Mx + q.
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


@conversions.register("soclcp-cp")
@dataclass(frozen=True)
class SOCLCPtoCP(Conversion):
    """A cone LCP for solvers of nonlinear ones. Trace: empty."""

    name = "soclcp-cp"
    source = "soclcp"
    target = "cp"
    equation = "(17)"
    kind = Kind.EQUIVALENT
    cost = 4.0

    def obstacle(self, problem: SOCLCP) -> str | None:
        return maps.too_large(problem.M)

    def apply(self, problem: SOCLCP) -> tuple[CP, Trace]:
        self.require(problem)
        F = maps.affine(problem.M, problem.q)
        return CP(F=F, **cone_fields(problem.K)), {}  # pyright: ignore[reportArgumentType]

    def lift(self, point: CPPoint, trace: Trace) -> SOCLCPPoint:
        return SOCLCPPoint(x=point.x)

    def push(self, point: SOCLCPPoint, trace: Trace) -> CPPoint:
        return CPPoint(x=point.x, lam=np.zeros(0))
