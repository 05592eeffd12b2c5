"""PATH, the standard solver of mixed complementarity problems, through GAMS."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_adapters.gams_mcp import GamsMCP, gams_spec


class GamsPath(GamsMCP):
    """Newton's method on the normal map, each linear problem solved by Lemke's pivoting."""

    guest = "path"

    def settings(self, tolerances: Mapping[str, float], budget: Budget) -> Mapping[str, Any]:
        """Return the option file: its own default is 1e-6; its limit of pivots is raised to GAMS', which the budget
        bounds."""
        return {**tolerances, "cumulative_iteration_limit": budget.iterations or 1_000_000}


def _spec(name: str, node: str, **more: Any) -> SolverSpec:
    return gams_spec(
        name,
        node,
        summary="PATH through GAMS: Newton on the normal map, Lemke pivoting inside",
        method="Newton with pivoting",
        citation="Dirkse and Ferris, Optim. Methods Softw. 5 (1995); Ferris and Munson, ibid. 12 (1999)",
        install="pip install gamspy",
        starts=True,
        **more,
    )


@register
class PathLCP(GamsPath):
    """The method for the LCP."""

    spec: ClassVar[SolverSpec] = _spec("gams-path", "lcp")


@register
class PathMLCP(GamsPath):
    """The method for the MLCP, its equations as they are."""

    spec: ClassVar[SolverSpec] = _spec("gams-path-mlcp", "mlcp")
