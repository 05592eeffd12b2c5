"""VI → cone complementarity problem, X a cone (equations (22) and (17)).

Source  −F(z) ∈ N_X(z),  X = {z ∈ K : Az ≥ 0, and bounds that are 0}, K a product of cones.
Target  C ∋ x ⟂ F(x) ∈ C*,  C = {x ∈ K′ : Ax ≥ 0}; K′ is K with {0} and ℝ₊ for the components with bounds.
Lift    z = x, λ.        Push  x = z, λ.
Kind    equivalent: with y = 0 and y = 2z in the inequality, F(z)ᵀz = 0, and then F(z)ᵀy ≥ 0 on X.
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.conversions import simple_sets
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.conic import cone_fields
from cpbench.formulations.cp import CP, CPPoint
from cpbench.formulations.variational import VIPoint
from cpbench.formulations.vi import VI


@conversions.register("vi-cp")
@dataclass(frozen=True)
class VItoCP(Conversion):
    """A variational inequality over a cone. Trace: empty."""

    name = "vi-cp"
    source = "vi"
    target = "cp"
    equation = "(22) → (17)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def obstacle(self, problem: VI) -> str | None:
        if problem.g.rows or problem.d.size:
            return f"X has {problem.g.rows} rows g(z) ≥ 0 and {problem.d.size} rows Cz = d; use vi-ge"
        if problem.b.any():
            return f"the rows Az ≥ b have max|b| = {abs(problem.b).max():.1e}, so that X is not a cone; use vi-ge"
        why = simple_sets.no_cone(problem)
        return f"{why}; use vi-ge" if why else None

    def apply(self, problem: VI) -> tuple[CP, Trace]:
        self.require(problem)
        K = cone_fields(simple_sets.as_cone(problem))
        return CP(F=problem.F, A=problem.A, start=problem.start, **K), {}  # pyright: ignore[reportArgumentType]

    def lift(self, point: CPPoint, trace: Trace) -> VIPoint:
        return VIPoint(z=point.x, lam=point.lam)

    def push(self, point: VIPoint, trace: Trace) -> CPPoint:
        return CPPoint(x=point.z, lam=point.lam)
