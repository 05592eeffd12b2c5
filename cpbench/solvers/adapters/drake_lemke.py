"""Drake's Lemke: complementary pivoting that solves a linear system for each pivot instead of updating a tableau."""

from __future__ import annotations

from typing import Any

from cpbench.formulations.lcp import LCP
from cpbench.matrices import max_abs
from cpbench.solvers.adapters.drake_lcp import CITATION, LICENCE, DrakeLCP
from cpbench.solvers.base import SolverSpec, Trait, register


@register
class DrakeLemke(DrakeLCP):
    """Drake's `UnrevisedLemkeSolver`, without perturbation or lexicographic rule: a cycle ends it, as does a ray."""

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
