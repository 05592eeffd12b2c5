"""MiCP → smooth equations by Evtushenko and Purtov's function (equations (31) and (38), its sign mended).

Source  lb ≤ z ≤ ub: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
Target  Φ(z) = 0 with φ(a, b) = ab − ½ min(0, a + b)². (38) has a plus, which is also zero at a = −1, b = 2 − √3.
Lift    z.        Push  z.
Kind    equivalent. Φ is continuously differentiable, its Jacobian singular where a = b = 0: Φ = δ leaves min(a, b)
        between δ and √δ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cpbench.conversions.base import conversions
from cpbench.conversions.complementarity_functions import MiCPtoEquation
from cpbench.formulations.base import Trace
from cpbench.formulations.expressions.recording import minimum


@conversions.register("micp-equation-ep")
@dataclass(frozen=True)
class MiCPtoEquationEP(MiCPtoEquation):
    """Evtushenko–Purtov's equations. Trace: empty."""

    name = "micp-equation-ep"
    equation = "(38)"
    cost = 2.4

    def function(self, a: Any, b: Any) -> Any:
        negative = minimum(a + b, 0.0)
        return a * b - 0.5 * negative * negative

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for ε²: a product of ε² may be that of two numbers of size ε."""
        return min(tolerance, tolerance**2)
