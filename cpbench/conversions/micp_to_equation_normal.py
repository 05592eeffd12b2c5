"""MiCP → nonsmooth equations by the normal map (equations (26) and (31)).

Source  lb ≤ z ≤ ub: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
Target  F(P(x)) + x − P(x) = 0, P the projection on the box: it is zero at x = z − F(z), not at z.
Lift    z = P(x).        Push  x = z − F(z).
Kind    equivalent. F is asked for values in the box alone (Robinson, Mathematics of Operations Research 17, 1992).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions import maps
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.equation import Equation, EquationPoint
from cpbench.formulations.expressions.recording import MapRecorder, maximum, minimum
from cpbench.formulations.micp import MiCP, MiCPPoint
from cpbench.foundation.cones import project_box


@conversions.register("micp-equation-normal")
@dataclass(frozen=True)
class MiCPtoEquationNormal(Conversion):
    """The normal map as a system of equations. Trace: `lb`, `ub`, and `F` for `push`."""

    name = "micp-equation-normal"
    source = "micp"
    target = "equation"
    equation = "(26)"
    kind = Kind.EQUIVALENT
    cost = 2.3

    def apply(self, problem: MiCP) -> tuple[Equation, Trace]:
        record = MapRecorder(problem.start.size)
        x, z = record.z, record.z.copy()
        for bounds, clip in ((problem.lb, maximum), (problem.ub, minimum)):
            at = np.flatnonzero(np.isfinite(bounds))
            if at.size:
                z[at] = clip(z[at], bounds[at])
        target = Equation(F=record.map(record(problem.F, z) + x - z), start=problem.start)
        return target, {"lb": problem.lb, "ub": problem.ub, "F": maps.kept(problem.F)}

    def lift(self, point: EquationPoint, trace: Trace) -> MiCPPoint:
        return MiCPPoint(z=project_box(point.z, trace["lb"], trace["ub"]))

    def push(self, point: MiCPPoint, trace: Trace) -> EquationPoint:
        return EquationPoint(z=point.z - maps.restored(trace["F"])(point.z))
