"""MILES, a Newton method with Lemke's pivoting, through GAMS."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_adapters.gams_mcp import GamsMCP, gams_spec


class Miles(GamsMCP):
    """Josephy's Newton method: linearise, solve the LCP by Lemke's algorithm, damp; for an LCP one pass of Lemke."""

    guest = "miles"

    def settings(self, tolerances: Mapping[str, float], budget: Budget) -> Mapping[str, Any]:
        """Return the option file: `contol` is a deviation in the 1-norm, absolute: 1e-6 by default."""
        return tolerances


def _spec(name: str, node: str, **more: Any) -> SolverSpec:
    return gams_spec(
        name,
        node,
        summary="MILES through GAMS: Newton with Lemke pivoting",
        method="Newton with pivoting",
        citation="Rutherford, MILES: a mixed inequality and nonlinear equation solver (1993)",
        install="pip install gamspy; gamspy install solver miles",
        **more,
    )


@register
class MilesLCP(Miles):
    """The method for the LCP."""

    spec: ClassVar[SolverSpec] = _spec("gams-miles", "lcp")


@register
class MilesMLCP(Miles):
    """The method for the MLCP, its equations as they are."""

    spec: ClassVar[SolverSpec] = _spec(
        "gams-miles-mlcp",
        "mlcp",
        known_failures={"planted-singular": "A of rank 11 of 12: gives up after one pivot at error 1.2, and says so"},
    )
