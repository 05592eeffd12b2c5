"""quadprog, called through qpsolvers: the dual active set of Goldfarb and Idnani."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from cpbench.solvers.base import Claim, SolverSpec, Trait, register
from cpbench_adapters.qp_backend import QPSolversBackend
from cpbench_adapters.qp_tolerances import Settings


@register
class Quadprog(QPSolversBackend):
    spec = SolverSpec(
        name="quadprog",
        node="qp",
        summary="dual active set of Goldfarb and Idnani, dense, Q positive definite",
        method="dual active set",
        citation="Goldfarb and Idnani, Math. Programming 27 (1983)",
        requires=("qpsolvers", "quadprog"),
        install="pip install 'cpbench[gpl]'",
        licence="GPL-2.0-or-later",
        traits=frozenset({Trait.DETERMINISTIC}),
    )
    sparse = False
    bounds_as_rows = True
    definite = True
    claims = {"solved": Claim.SOLVED, "no solution": Claim.INFEASIBLE}

    def status(self, solution: Any, settings: Settings) -> str:
        # quadprog only ever raises "constraints are inconsistent, no solution"; qpsolvers turns it into found=False
        return "solved" if solution.found else "no solution"

    def counters(self, solution: Any) -> Mapping[str, int]:
        return {"iterations": int(solution.extras["iterations"][0])} if solution.found else {}
