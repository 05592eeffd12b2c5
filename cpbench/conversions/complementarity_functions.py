"""NCP functions φ, zero exactly where 0 ≤ a ⟂ b ≥ 0, and the equations Φ(z) = 0 that they make of a MiCP.

All have the sign of min(a, b): the lecture's (36) and (37) are −φ. Then Φᵢ is

    Fᵢ                                          where zᵢ is free,
    φ(zᵢ − lbᵢ, Fᵢ)                             with a lower bound,      −φ(ubᵢ − zᵢ, −Fᵢ)    with an upper one,
    φ(zᵢ − lbᵢ, −φ(ubᵢ − zᵢ, −Fᵢ))              with both (Billups, "Algorithms for complementarity problems and
                                                generalized equations", thesis, Wisconsin 1995), and
    zᵢ − lbᵢ                                    where the two are the same.

For φ = min the third is the median of zᵢ − lbᵢ, zᵢ − ubᵢ and Fᵢ, so that Φ is the natural map z − P(z − F(z)).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import numpy as np

from cpbench.conversions.base import Conversion
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.equation import Equation, EquationPoint
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.recording import MapRecorder
from cpbench.formulations.micp import MiCP, MiCPPoint

TSENG = (2.0 - 2.0**0.5) / (2.0 + 2.0**0.5)
"""How much smaller φ may be beside its scale than min(a, b) beside its own, for Fischer and Burmeister's φ:
(2 − √2)|min(a, b)| ≤ |φ(a, b)| ≤ (2 + √2)|min(a, b)| (Tseng, J. Optimization Theory and Applications 89, 1996)."""

Function: TypeAlias = Callable[[Any, Any], Any]
"""φ of two columns of symbols."""


def equations(problem: MiCP, phi: Function) -> Map:
    """Return Φ."""
    record = MapRecorder(problem.start.size)
    z, lb, ub = record.z, problem.lb, problem.ub
    F = record(problem.F, z)
    below, above = np.isfinite(lb), np.isfinite(ub)
    result = z.copy()
    for members, make in (
        (~below & ~above, lambda x, w, lo, up: w),
        (below & ~above, lambda x, w, lo, up: phi(x - lo, w)),
        (~below & above, lambda x, w, lo, up: -phi(up - x, -w)),
        (below & above & (lb < ub), lambda x, w, lo, up: phi(x - lo, -phi(up - x, -w))),
        (below & above & (lb == ub), lambda x, w, lo, up: x - lo),
    ):
        at = np.flatnonzero(members)
        if at.size:
            result[at] = make(z[at], F[at], lb[at], ub[at])
    return record.map(result)


@dataclass(frozen=True)
class MiCPtoEquation(Conversion):
    """Base of the edges by an NCP function, their `function`. Trace: empty."""

    source: ClassVar[str] = "micp"
    target: ClassVar[str] = "equation"
    kind: ClassVar[Kind] = Kind.EQUIVALENT

    @abstractmethod
    def function(self, a: Any, b: Any) -> Any:
        """Return φ(a, b)."""

    def apply(self, problem: MiCP) -> tuple[Equation, Trace]:
        self.require(problem)
        return Equation(F=equations(problem, self.function), start=problem.start), {}

    def lift(self, point: EquationPoint, trace: Trace) -> MiCPPoint:
        return MiCPPoint(z=point.z)

    def push(self, point: MiCPPoint, trace: Trace) -> EquationPoint:
        return EquationPoint(z=point.z)
