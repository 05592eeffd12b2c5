"""Cone complementarity problem → VI (equations (17) and (22)).

Source  C ∋ x ⟂ F(x) ∈ C*,  C = {x ∈ K : Ax ≥ 0}.
Target  F(z)ᵀ(y − z) ≥ 0 for all y ∈ C.
Lift    x = z, λ.        Push  z = x, λ.
Kind    equivalent: F(x)ᵀx = 0 and F(x)ᵀy ≥ 0 on C are the inequality for all y.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.cp import CP, CPPoint
from cpbench.formulations.variational import VIPoint
from cpbench.formulations.vi import VI


@conversions.register("cp-vi")
@dataclass(frozen=True)
class CPtoVI(Conversion):
    """A cone complementarity problem read as a variational inequality. Trace: empty."""

    name = "cp-vi"
    source = "cp"
    target = "vi"
    equation = "(17) → (22)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def apply(self, problem: CP) -> tuple[VI, Trace]:
        return VI(F=problem.F, **problem.data()), {}  # pyright: ignore[reportArgumentType]

    def lift(self, point: VIPoint, trace: Trace) -> CPPoint:
        return CPPoint(x=point.z, lam=point.lam)

    def push(self, point: CPPoint, trace: Trace) -> VIPoint:
        return VIPoint(z=point.x, lam=point.lam)
