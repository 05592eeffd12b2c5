"""All solutions of a small MLCP: the free unknowns into the basis once, then each of the 2ᵐ complementary bases."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.linear import LCP, MLCP
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, register
from cpbench_solvers.lcp import claims as lcp_claims
from cpbench_solvers.lcp.enumeration import LARGEST, Enumeration, EnumerationOptions, enumerate_bases, enumeration_spec
from cpbench_solvers.mlcp.claims import ScaledMLCP, conclude, farkas, refined, scale
from cpbench_solvers.mlcp.pivoting import Reduction


@register
class MLCPEnumeration(Solver):
    """Enumeration of all bases: answers the solution with the least error and says how many there are. Where A is
    singular and free unknowns are idle, a solution stands for all those that differ in them only."""

    spec: ClassVar[SolverSpec] = enumeration_spec(
        name="enumeration-mlcp",
        node="mlcp",
        summary=f"all solutions of up to {LARGEST} pairs, by the 2^m complementary bases",
        citation="Murty 1988, section 1.3; Cottle, Pang and Stone 1992, section 2.3",
    )

    def obstacle(self, problem: MLCP) -> str | None:
        m = problem.b.size
        return None if m <= LARGEST else f"looks at 2^m bases, m = {m} (at most {LARGEST}): use lemke-mlcp"

    def setup(self, problem: MLCP, budget: Budget, options: EnumerationOptions) -> ScaledMLCP:
        return scale(problem)

    def solve(
        self,
        prepared: ScaledMLCP,
        budget: Budget,
        options: EnumerationOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        reduction = Reduction(prepared)
        enumeration = enumerate_bases(lcp_claims.scale(LCP(M=reduction.M, q=reduction.q)), budget, options)
        answers = refined_answers(prepared, reduction, enumeration, budget)
        enumeration.solutions = [x for _, x in answers]  # an equality without unknowns may exclude what bases give
        whole = 2 ** (prepared.k.size - prepared.free)
        counters = {"iterations": enumeration.bases, "singular_bases": enumeration.singular, "solutions": len(answers)}
        message = str(enumeration) if enumeration.bases == whole else f"{enumeration}, of {whole}"
        if answers:
            error, x = min(answers, key=lambda answer: answer[0])
            output = conclude(prepared, x, budget, counters, error=error)
            return SolverOutput(claim=output.claim, point=output.point, counters=counters, message=message)
        certificate = farkas(prepared, budget)
        if certificate is not None:
            message += "; y with Aᵀy + Dᵀz = 0, Cᵀy + Bᵀz ≤ 0, aᵀy + bᵀz < 0 to rounding (Farkas)"
            return SolverOutput(claim=Claim.INFEASIBLE, counters=counters, certificate=certificate, message=message)
        claim = Claim.FAILED if enumeration.bases == whole else Claim.MAX_ITER
        return conclude(prepared, np.zeros(prepared.k.size), budget, counters, otherwise=claim, message=message)


def refined_answers(
    prepared: ScaledMLCP, reduction: Reduction, enumeration: Enumeration, budget: Budget
) -> list[tuple[float, Vector]]:
    """Return error and x of each solution, refined where needed; without what is none on the whole problem."""
    answers: list[tuple[float, Vector]] = []
    for z in enumeration.solutions:
        x = reduction.recover(z)
        error = prepared.error(x)
        if not error <= budget.tolerance:
            x, error = refined(prepared, x, error, budget.tolerance)
        if error <= budget.tolerance:
            answers.append((error, x))
    return answers
