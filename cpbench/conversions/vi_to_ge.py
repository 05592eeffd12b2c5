"""VI → generalized equation: a simple set as it is, rows by multipliers (equations (22), (24) and (27)).

Source  −F(z) ∈ N_X(z),  X = {z ∈ S : Az ≥ b, Cz = d, g(z) ≥ 0},  S = {z ∈ K : lb ≤ z ≤ ub}.
Target  0 ∈ (F − Aᵀλ − Cᵀμ − ∇gᵀν, Az − b, Cz − d, g) + N(z, λ, μ, ν) over S × ℝ₊ × ℝ × ℝ₊; F itself without rows.
Lift    z, λ, μ, ν.        Push  the same.
Kind    equivalent where there are no rows, or K is a box and a qualification is known as for vi-micp; one-way
        otherwise: the normal cone of X may be more than that of S and those of the rows together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions import first_order, qualification
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Problem, Trace
from cpbench.formulations.ge import GE, GEPoint
from cpbench.formulations.variational import VIPoint
from cpbench.formulations.vi import VI
from cpbench.foundation.product_cones import Cone


@conversions.register("vi-ge")
@dataclass(frozen=True)
class VItoGE(Conversion):
    """The inequality as an inclusion. Trace: `n`, `m`, `k`, the sizes of z, λ and μ."""

    name = "vi-ge"
    source = "vi"
    target = "ge"
    equation = "(24)"
    kind = Kind.ONE_WAY
    best_kind = Kind.EQUIVALENT
    cost = 1.0

    def exactness(self, problem: Problem) -> Kind:
        assert isinstance(problem, VI)
        return self.kind if _unqualified(problem) else self.best_kind

    def reservation(self, problem: VI) -> str:
        return f"no constraint qualification of X is known: {_unqualified(problem)}"

    def apply(self, problem: VI) -> tuple[GE, Trace]:
        F, least, most = first_order.inequality_conditions(problem)
        fields = {name: getattr(problem, name) for name in ("cone_kind", "cone_size", "cone_mu", "cone_mu_r")}
        if fields["cone_kind"].size:  # the multipliers are one more free factor, with their bounds
            last = {"cone_kind": float(Cone.FREE), "cone_size": float(least.size)}
            fields = {name: np.append(value, last.get(name, 0.0)) for name, value in fields.items()}
        target = GE(
            F=F,
            lb=np.concatenate([problem.lb, least]),
            ub=np.concatenate([problem.ub, most]),
            start=np.concatenate([problem.start, np.zeros(least.size)]),
            **fields,
        )
        return target, first_order.inequality_sizes(problem)

    def lift(self, point: GEPoint, trace: Trace) -> VIPoint:
        return first_order.inequality_point(point.z, trace)

    def push(self, point: VIPoint, trace: Trace) -> GEPoint:
        return GEPoint(z=first_order.inequality_vector(point))


def _unqualified(problem: VI) -> str:
    rows = problem.b.size + problem.d.size + problem.g.rows
    if rows and not problem.only_box:
        return f"K is no box, and there are {rows} rows"
    return qualification.of_set(problem)
