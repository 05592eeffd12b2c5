"""Conversions of ncp."""

from __future__ import annotations

import numpy as np

from cpbench.conversions import nonlinear
from cpbench.conversions.base import SameUnknowns, edge
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.linear import LCP
from cpbench.formulations.nonlinear import NCP, MiCP


@edge("ncp-lcp", equation="(19) → (13)", kind=Kind.EQUIVALENT, cost=1.0)
class NCPtoLCP(SameUnknowns):
    """NCP → LCP, F affine (equations (19) and (13)).

    Source  0 ≤ z ⟂ F(z) ≥ 0,  F(z) = Mz + q.
    Target  0 ≤ z ⟂ Mz + q ≥ 0.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def obstacle(self, problem: NCP) -> str | None:
        return nonlinear.curved(problem.F, "F")

    def apply(self, problem: NCP) -> tuple[LCP, Trace]:
        self.require(problem)
        F = problem.F.compiled
        return LCP(M=F.M, q=F.q), {}


@edge("ncp-micp", equation="(19) → (21)", kind=Kind.EQUIVALENT, cost=1.0)
class NCPtoMiCP(SameUnknowns):
    """NCP → MiCP, all of it complementary (equations (19) to (21)).

    Source  0 ≤ z ⟂ F(z) ≥ 0.
    Target  the MiCP of F with lb = 0, ub = ∞.
    Lift    z.        Push  z.
    Kind    equivalent.
    """

    def apply(self, problem: NCP) -> tuple[MiCP, Trace]:
        n = problem.start.size
        return MiCP(F=problem.F, lb=np.zeros(n), ub=np.full(n, np.inf), start=problem.start), {}
