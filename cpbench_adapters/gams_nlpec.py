"""NLPEC, which writes a complementarity problem as a nonlinear program and hands it to CONOPT, through GAMS."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from cpbench.formulations import LCP, MLCP
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_adapters.gams_mcp import GamsMCP, gams_spec


class Nlpec(GamsMCP):
    """Complementarity as products x·s = 0 with slacks s, NLPEC's default reformulation."""

    guest = "nlpec"

    def rows(self, problem: LCP | MLCP) -> int:
        """Return a product for every pair, and an objective."""
        free = problem.a.size if isinstance(problem, MLCP) else 0
        return 2 * super().rows(problem) - free + 1

    def settings(self, tolerances: Mapping[str, float], budget: Budget) -> Mapping[str, Any]:
        """Return the option file: `testTol` is NLPEC's check of complementarity; CONOPT keeps its own tolerances.
        It is named, since it is none of the solvers whose results may not be published."""
        return {**tolerances, "subSolver": "conopt"}


def _spec(name: str, node: str, **more: Any) -> SolverSpec:
    return gams_spec(
        name,
        node,
        summary="NLPEC through GAMS: complementarity as products, solved by CONOPT",
        method="nonlinear program",
        citation="Ferris, Dirkse and Meeraus, in Frontiers in Applied General Equilibrium Modeling (2005)",
        install="pip install gamspy",
        **more,
    )


@register
class NlpecLCP(Nlpec):
    """The method for the LCP."""

    spec: ClassVar[SolverSpec] = _spec(
        "gams-nlpec",
        "lcp",
        known_failures={
            "tolerance-1e-08": "optimal at error 8.6e-7 for a definite M, n = 120: CONOPT keeps its own tolerances"
        },
    )


@register
class NlpecMLCP(Nlpec):
    """The method for the MLCP, its equations as they are."""

    spec: ClassVar[SolverSpec] = _spec(
        "gams-nlpec-mlcp",
        "mlcp",
        known_failures={"planted-singular": "not monotone: CONOPT ends locally infeasible at error 0.056, and says so"},
    )
