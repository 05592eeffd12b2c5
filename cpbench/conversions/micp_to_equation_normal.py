"""MiCP → nonsmooth equations by the normal map (equations (26) and (31)).

Source  lb ≤ z ≤ ub: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
Target  F(P(x)) + x − P(x) = 0, P the projection on the box: it is zero at x = z − F(z), not at z.
Lift    z = P(x).        Push  x = z − F(z).
Kind    equivalent. F is asked for values in the box alone (Robinson, Mathematics of Operations Research 17, 1992).
"""

from __future__ import annotations

from dataclasses import dataclass

from cpbench.cones import project_box
from cpbench.conversions import maps
from cpbench.conversions.base import Conversion, conversions
from cpbench.expressions import Map
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.equation import Equation, EquationPoint
from cpbench.formulations.micp import MiCP, MiCPPoint


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
        import casadi as ca

        x = ca.SX.sym("x", problem.start.size)
        z = ca.SX(x)
        for bounds, clip in ((problem.lb, ca.fmax), (problem.ub, ca.fmin)):
            at = [i for i, bound in enumerate(bounds.tolist()) if abs(bound) != float("inf")]
            if at:
                z[at] = clip(z[at], ca.DM(bounds[at]))
        target = Equation(F=Map.from_casadi(x, problem.F.sx(z) + x - z), start=problem.start)
        return target, {"lb": problem.lb, "ub": problem.ub, "F": maps.kept(problem.F)}

    def lift(self, point: EquationPoint, trace: Trace) -> MiCPPoint:
        return MiCPPoint(z=project_box(point.z, trace["lb"], trace["ub"]))

    def push(self, point: MiCPPoint, trace: Trace) -> EquationPoint:
        return EquationPoint(z=point.z - maps.restored(trace["F"])(point.z))
