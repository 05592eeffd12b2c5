"""VI → MiCP: a box as it is, rows by multipliers (equations (22) and (20)).

Source  −F(z) ∈ N_X(z),  X = {z ∈ K : lb ≤ z ≤ ub, Az ≥ b, Cz = d, g(z) ≥ 0}, K a product of {0}, ℝ and ℝ₊.
Target  x = (z, λ, μ, ν),  (F − Aᵀλ − Cᵀμ − ∇gᵀν, Az − b, Cz − d, g),  z in its box,  λ ≥ 0,  μ free,  ν ≥ 0.
Lift    z, λ, μ, ν, the parts of x.        Push  x = (z, λ, μ, ν).
Kind    equivalent where the rows are affine, or g is concave and the start is Slater's point (`qualification`);
        for any other concave g one-way: a solution may have no multipliers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions import first_order, qualification, simple_sets
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.micp import MiCP, MiCPPoint
from cpbench.formulations.variational import VIPoint
from cpbench.formulations.vi import VI


@conversions.register("vi-micp")
@dataclass(frozen=True)
class VItoMiCP(Conversion):
    """A VI over a box with rows. Trace: `n`, `m`, `k`, the sizes of z, λ and μ."""

    name = "vi-micp"
    source = "vi"
    target = "micp"
    equation = "(22) → (20)"
    kind = Kind.ONE_WAY
    best_kind = Kind.EQUIVALENT
    cost = 2.0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, VI)
        return self.kind if qualification.of_set(problem) else self.best_kind

    def reservation(self, problem: VI) -> str:
        return f"no constraint qualification of X is known: {qualification.of_set(problem)}"

    def obstacle(self, problem: VI) -> str | None:
        return simple_sets.no_box(problem, "vi-ge")

    def apply(self, problem: VI) -> tuple[MiCP, Trace]:
        self.require(problem)
        F, least, most = first_order.inequality_conditions(problem)
        lb, ub = problem.box
        target = MiCP(
            F=F,
            lb=np.concatenate([lb, least]),
            ub=np.concatenate([ub, most]),
            start=np.concatenate([problem.start, np.zeros(least.size)]),
        )
        return target, first_order.inequality_sizes(problem)

    def lift(self, point: MiCPPoint, trace: Trace) -> VIPoint:
        return first_order.inequality_point(point.z, trace)

    def push(self, point: VIPoint, trace: Trace) -> MiCPPoint:
        return MiCPPoint(z=first_order.inequality_vector(point))
