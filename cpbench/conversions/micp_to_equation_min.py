"""MiCP → nonsmooth equations by the minimum (equations (31) and (35)).

Source  lb ≤ z ≤ ub: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
Target  Φ(z) = 0 with φ(a, b) = min(a, b): the natural map; the median of z − lb, z − ub and F with two bounds.
Lift    z.        Push  z.
Kind    equivalent. Φ is piecewise smooth, and ½‖Φ‖² is not differentiable.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cpbench.conversions.base import conversions
from cpbench.conversions.complementarity_functions import MiCPtoEquation
from cpbench.formulations.expressions.recording import minimum


@conversions.register("micp-equation-min")
@dataclass(frozen=True)
class MiCPtoEquationMin(MiCPtoEquation):
    """The natural map as a system of equations. Trace: empty."""

    name = "micp-equation-min"
    equation = "(35)"
    cost = 2.1

    def function(self, a: Any, b: Any) -> Any:
        return minimum(a, b)
