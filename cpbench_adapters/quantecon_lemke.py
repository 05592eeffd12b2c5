"""QuantEcon's Lemke: a compiled tableau with the lexicographic ratio test."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.foundation.matrices import Dense, Vector
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.stopping import Stopping
from cpbench_adapters.dense_lcp import dense_matrix, too_large

ZEROS = "an absolute zero, which takes entries for 0 where the data are far below 1"


@dataclass(frozen=True)
class QuantEconLemkeOptions:
    """QuantEcon's own defaults. `max_pivots` : unless the budget bounds the iterations. `pivot_tolerance` : entries
    up to this do not block. `tie_tolerance` : ratios that differ by no more count as tied. Both are absolute."""

    max_pivots: int = 1_000_000
    pivot_tolerance: float = 1e-7
    tie_tolerance: float = 1e-13


@register
class QuantEconLemke(Solver):
    """QuantEcon's Lemke, `quantecon.optimize.lcp_lemke`, covering vector e. Exact pivoting: it has no tolerance to
    translate.

    M and q go in as they are, for its pivot tolerance is its own business, units of the data included.
    """

    spec = SolverSpec(
        name="quantecon-lemke",
        node="lcp",
        summary="QuantEcon's lcp_lemke: Lemke's pivoting, lexicographic ratio test, dense tableau",
        method="pivoting",
        citation="Murty, Linear Complementarity, Linear and Nonlinear Programming (1988); QuantEcon.py",
        requires=("quantecon",),
        install="pip install quantecon",
        licence="MIT",
        traits=frozenset({Trait.DETERMINISTIC}),
        options=QuantEconLemkeOptions,
    )
    claims = {0: Claim.SOLVED, 1: Claim.MAX_ITER, 2: Claim.FAILED}
    words = {0: "", 1: "iteration limit reached", 2: "secondary ray"}

    def stopping(self, tolerance: float, problem: LCP | None = None) -> Stopping:
        return Stopping(test="pivoting: no tolerance; its zeros are absolute", differs=ZEROS, factor=math.inf)

    def obstacle(self, problem: LCP) -> str | None:
        return too_large(problem, 3)  # M and the tableau of n x (2n + 2)

    def setup(self, problem: LCP, budget: Budget, options: QuantEconLemkeOptions) -> tuple[Dense, Vector]:
        return dense_matrix(problem), problem.q

    def solve(
        self,
        prepared: tuple[Dense, Vector],
        budget: Budget,
        options: QuantEconLemkeOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        from quantecon.optimize import lcp_lemke
        from quantecon.optimize.linprog_simplex import PivOptions

        pivoting = PivOptions(tol_piv=options.pivot_tolerance, tol_ratio_diff=options.tie_tolerance)
        limit = options.max_pivots if budget.iterations is None else budget.iterations
        result = lcp_lemke(*prepared, None, limit, pivoting)
        return SolverOutput(
            claim=self.claims[result.status],
            point=LCPPoint(result.z) if np.isfinite(result.z).all() else None,
            counters={"pivots": int(result.num_iter)},
            message=self.words[result.status],
        )

    def warmup(self) -> None:
        self.run(LCP(M=np.eye(2), q=np.array([-1.0, -2.0])))
