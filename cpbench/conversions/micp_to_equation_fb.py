"""MiCP → nonsmooth equations by Fischer and Burmeister's function (equations (31) and (36)).

Source  lb ≤ z ≤ ub: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
Target  Φ(z) = 0 with φ(a, b) = a + b − √(a² + b²), which is (36) with the other sign.
Lift    z.        Push  z.
Kind    equivalent. ½‖Φ‖² is continuously differentiable; Φ is not where a = b = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cpbench.conversions.base import conversions
from cpbench.conversions.complementarity_functions import TSENG, MiCPtoEquation
from cpbench.formulations.base import Trace
from cpbench.formulations.ncp_functions import symbolic_fischer_burmeister


@conversions.register("micp-equation-fb")
@dataclass(frozen=True)
class MiCPtoEquationFB(MiCPtoEquation):
    """Fischer–Burmeister's equations. Trace: empty."""

    name = "micp-equation-fb"
    equation = "(36)"
    cost = 2.0

    def function(self, a: Any, b: Any) -> Any:
        return symbolic_fischer_burmeister(a, b)

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Apply Tseng's bounds, twice where a variable has two bounds. They hold where 0 is in the box: the scale of Φ
        is its size at 0, wherever the box is.
        """
        return TSENG**2 * tolerance
