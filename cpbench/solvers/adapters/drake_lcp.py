"""Drake's LCP solvers, through `MathematicalProgram`: of both only `Solve` is bound in Python.

Neither takes an option there (unknown ones are ignored without a word), nor tells its pivots: tolerances, limits
and counters of Drake stay what they are inside. Its zero tolerance is n·eps·max|M|, far below ours.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np

from cpbench.formulations.lcp import LCP, LCPPoint
from cpbench.solvers.adapters.dense_lcp import dense_matrix, too_large
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, package_version

CITATION = "Tedrake and the Drake Development Team: Drake, model-based design and verification for robotics (2019)"
LICENCE = "BSD-3-Clause"
"""Of Drake itself; its wheel bundles others (METADATA: Various) that these solvers do not call."""


class DrakeLCP(Solver):
    """One LCP as a MathematicalProgram with one LinearComplementarityConstraint, made in `setup`."""

    @abstractmethod
    def guest(self) -> Any:
        """Return Drake's solver object."""

    def obstacle(self, problem: LCP) -> str | None:
        if problem.q.size == 0:
            return "has no unknown (n = 0): Drake refuses an empty program"
        return too_large(problem, 4)  # ours, the constraint's, and the guest's two working matrices

    def setup(self, problem: LCP, budget: Budget, options: Any) -> tuple[Any, Any]:
        from pydrake.solvers import MathematicalProgram

        program = MathematicalProgram()
        z = program.NewContinuousVariables(problem.q.size)
        program.AddLinearComplementarityConstraint(dense_matrix(problem), problem.q, z)
        return program, z

    def solve(
        self,
        prepared: tuple[Any, Any],
        budget: Budget,
        options: Any,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        program, z = prepared
        try:
            result = self.guest().Solve(program, None, None)
        except SystemExit as abort:  # pydrake's way to pass on a failed assertion
            raise RuntimeError(f"Drake aborts: {abort}") from None
        found = np.asarray(result.GetSolution(z), dtype=float)
        point = LCPPoint(found) if np.isfinite(found).all() else None
        claim = Claim.SOLVED if result.is_success() else Claim.FAILED
        return SolverOutput(claim=claim, point=point, message=result.get_solution_result().name)

    def warmup(self) -> None:
        self.run(LCP(M=np.eye(2), q=np.array([-1.0, -2.0])))

    def version(self) -> str:
        return package_version("pydrake")
