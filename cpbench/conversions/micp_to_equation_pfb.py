"""MiCP → nonsmooth equations by the penalized Fischer–Burmeister function (equations (31) and (37)).

Source  lb ≤ z ≤ ub: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
Target  Φ(z) = 0 with φ(a, b) = λ(a + b − √(a² + b²)) + (1 − λ) max(0, a) max(0, b), 0 < λ < 1, which is (37) with
        the other sign (Chen, Chen and Kanzow, Mathematical Programming 88, 2000, who take λ = 0.95).
Lift    z.        Push  z.
Kind    equivalent.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cpbench.conversions.base import conversions
from cpbench.conversions.complementarity_functions import TSENG, MiCPtoEquation
from cpbench.formulations.base import Trace
from cpbench.formulations.expressions.recording import maximum
from cpbench.formulations.micp import MiCP
from cpbench.formulations.ncp_functions import symbolic_fischer_burmeister


@conversions.register("micp-equation-pfb")
@dataclass(frozen=True)
class MiCPtoEquationPenalized(MiCPtoEquation):
    """Penalized Fischer–Burmeister's equations. `share`: λ. Trace: empty."""

    name = "micp-equation-pfb"
    equation = "(37)"
    cost = 2.2

    share: float = 0.95

    def obstacle(self, problem: MiCP) -> str | None:
        return None if 0.0 < self.share < 1.0 else f"share is {self.share:g}, expected a number between 0 and 1"

    def function(self, a: Any, b: Any) -> Any:
        penalty = maximum(a, 0.0) * maximum(b, 0.0)
        return self.share * symbolic_fischer_burmeister(a, b) + (1.0 - self.share) * penalty

    def tolerance(self, tolerance: float, trace: Trace) -> float:
        """Ask for as much as Fischer and Burmeister's φ, of which this is at least λ times as large."""
        return (TSENG * self.share) ** 2 * tolerance
