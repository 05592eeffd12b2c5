"""Drake's LCP solvers, through `MathematicalProgram`: of both only `Solve` is bound in Python.

Neither takes an option there (unknown ones are ignored without a word), nor tells its pivots: tolerances, limits
and counters of Drake stay what they are inside. Its zero tolerance is n·eps·max|M|, far below ours.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import max_abs
from cpbench.solvers.base import (
    Budget,
    Claim,
    Record,
    Solver,
    SolverOutput,
    SolverSpec,
    Trait,
    package_version,
    register,
)
from cpbench.solvers.stopping import Stopping

CITATION = "Tedrake and the Drake Development Team: Drake, model-based design and verification for robotics (2019)"
ARRAYS, DENSE_BYTES = 4, 4e9
"""Dense n x n matrices that a solve keeps (ours, the constraint's, and two of the guest), and the most memory."""
LICENCE = "BSD-3-Clause"
"""Of Drake itself; its wheel bundles others (METADATA: Various) that these solvers do not call."""


class DrakeLCP(Solver):
    """One LCP as a MathematicalProgram with one LinearComplementarityConstraint, made in `setup`."""

    @abstractmethod
    def guest(self) -> Any:
        """Return Drake's solver object."""

    def stopping(self, tolerance: float, problem: LCP | None = None) -> Stopping:
        return Stopping(test="pivoting: no tolerance; its zero is n·eps·max|M|")

    def obstacle(self, problem: LCP) -> str | None:
        if problem.q.size == 0:
            return "has no unknown (n = 0): Drake refuses an empty program"
        n, size = problem.q.size, 8.0 * ARRAYS * problem.q.size**2
        if size <= DENSE_BYTES:
            return None
        most = f"{size / 1e9:.1f} GB (at most {DENSE_BYTES / 1e9:.0f} GB)"
        return f"keeps {ARRAYS} dense {n}x{n} matrices: {most}; use a sparse solver"

    def setup(self, problem: LCP, budget: Budget, options: Any) -> tuple[Any, Any]:
        from pydrake.solvers import MathematicalProgram

        program = MathematicalProgram()
        z = program.NewContinuousVariables(problem.q.size)
        program.AddLinearComplementarityConstraint(matrices.dense(problem.M), problem.q, z)
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
        solution = np.asarray(result.GetSolution(z), dtype=float)
        point = LCPPoint(solution) if np.isfinite(solution).all() else None
        claim = Claim.SOLVED if result.is_success() else Claim.FAILED
        return SolverOutput(claim=claim, point=point, message=result.get_solution_result().name)

    def warmup(self) -> None:
        self.run(LCP(M=np.eye(2), q=np.array([-1.0, -2.0])))

    def version(self) -> str:
        return package_version("pydrake")


@register
class DrakeLemke(DrakeLCP):
    """Drake's `UnrevisedLemkeSolver`: complementary pivoting that solves a linear system for each pivot.

    It has no perturbation and no lexicographic rule: a cycle ends it, as does a ray.
    """

    spec = SolverSpec(
        name="drake-lemke",
        node="lcp",
        summary="Drake's UnrevisedLemkeSolver: Lemke's pivoting with a linear solve a pivot, dense",
        method="pivoting",
        citation=f"Dai and Drumwright, arXiv:1608.03491 (2016); {CITATION}",
        requires=("pydrake",),
        install="pip install drake",
        licence=LICENCE,
        traits=frozenset({Trait.DETERMINISTIC}),
    )

    def obstacle(self, problem: LCP) -> str | None:
        if not max_abs(problem.M):
            return "M = 0: Drake's zero tolerance n·eps·max|M| would be 0, on which its Lemke aborts"
        return super().obstacle(problem)

    def guest(self) -> Any:
        from pydrake.solvers import UnrevisedLemkeSolver

        return UnrevisedLemkeSolver()


@register
class DrakeMoby(DrakeLCP):
    """Drake's `MobyLcpSolver`: Lemke's pivoting, and where it fails again on M + 10ᵏ·I, k = −20, −19, ..., 0.

    It tests an answer of a regularized problem on that problem, not on the one that was asked: its success is passed on
    as its claim, true or not. Ties are broken by the first index, which may cycle.
    """

    spec = SolverSpec(
        name="drake-moby",
        node="lcp",
        summary="Drake's MobyLcpSolver: Lemke, then Lemke on M + λI with growing λ, dense",
        method="pivoting",
        citation=f"Drumwright: Moby, a rigid body dynamics library; {CITATION}",
        requires=("pydrake",),
        install="pip install drake",
        licence=LICENCE,
        traits=frozenset({Trait.DETERMINISTIC}),
        known_failures={
            "check_infeasibility_is_proved_or_not_claimed_solved": "kSolutionFound where w₁ = −z₂ − z₃ − δ < 0, "
            "Pang's problem, at residual δ: 1e-4 here, 1.0 for δ = 1",
            "check_claims_hold_in_other_units": "kSolutionFound at error 0.82 where M and q are in 1e-6 of "
            "their unit: an absolute zero tolerance",
            "case-any": "kSolutionFound for a nonsymmetric M of no class, n = 12, at error 0.47",
        },
    )

    def guest(self) -> Any:
        from pydrake.solvers import MobyLcpSolver

        return MobyLcpSolver()
