"""MiCP → MLCP by linearization, one step of Josephy and Newton (MATH: A, B, C, D are blocks of F′).

Source  lb ≤ z ≤ ub: Fᵢ ≥ 0 at lbᵢ, Fᵢ ≤ 0 at ubᵢ, Fᵢ = 0 in between.
Target  the same with F(z_k) + F′(z_k)(z − z_k) in place of F(z). u are the free zᵢ; v = z − lb or ub − z from the
        bound nearer to 0, so z = c + Sx with x = (u, v); and with J the rows of the identity for variables of two
        bounds, one more y for each: 0 ≤ y ⟂ ub − lb − Jv ≥ 0.
Lift    z = c + Sx.        Push  x = S(z − c), y = what holds z at its second bound.
Kind    approximate: the solution of the source solves the target where z_k is that solution, and the error falls
        with the square of the distance of z_k to it. A step of a method, which no route takes unless it is named.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from cpbench.conversions import bounds
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.micp import MiCP, MiCPPoint
from cpbench.formulations.mlcp import MLCP, MLCPPoint
from cpbench.foundation import matrices
from cpbench.foundation.cones import project_box
from cpbench.foundation.matrices import Matrix, Vector


@conversions.register("micp-mlcp")
@dataclass(frozen=True)
class MiCPtoMLCP(Conversion):
    """`at`: z_k, the start of the problem if none is given.

    Trace: `free`, `bounded`, `both` (indices; the last among `bounded`), `c`, `S`, `M`, `q` of the linearization.
    """

    name = "micp-mlcp"
    source = "micp"
    target = "mlcp"
    equation = "Josephy–Newton"
    kind = Kind.APPROXIMATE
    cost = 2.0

    at: tuple[float, ...] = ()

    def obstacle(self, problem: MiCP) -> str | None:
        if self.at and len(self.at) != problem.start.size:
            return f"at has {len(self.at)} numbers, the problem has {problem.start.size} unknowns"
        z = self._point(problem)
        with np.errstate(all="ignore"):
            defined = np.isfinite(problem.F(z)).all() and np.isfinite(problem.F.jacobian(z).data).all()
        return None if defined else "F or its Jacobian is not finite at z_k; set another `at`"

    def _point(self, problem: MiCP) -> Vector:
        return project_box(np.array(self.at) if self.at else problem.start, problem.lb, problem.ub)

    def apply(self, problem: MiCP) -> tuple[MLCP, Trace]:
        self.require(problem)
        z, lb, ub = self._point(problem), problem.lb, problem.ub
        M = problem.F.jacobian(z)
        q = problem.F(z) - M @ z
        has_bound = np.isfinite(lb) | np.isfinite(ub)
        free, bounded = np.flatnonzero(~has_bound), np.flatnonzero(has_bound)
        both = np.flatnonzero((np.isfinite(lb) & np.isfinite(ub))[bounded])
        c, S = np.zeros(z.size), np.ones(z.size)
        c[bounded], S[bounded] = bounds.origin(lb[bounded], ub[bounded])
        scaled, shifted = matrices.sparse(matrices.scaled_both(M, S)), S * (q + M @ c)
        J = sp.csr_array((np.ones(both.size), (np.arange(both.size), both)), shape=(both.size, bounded.size))
        rows = bounded[both]
        target = MLCP(
            A=_part(scaled, free, free),
            B=matrices.block(
                [
                    [_part(scaled, bounded, bounded), matrices.transpose(J)],
                    [-J, matrices.zeros(both.size, both.size, J)],
                ]
            ),
            C=matrices.block([[_part(scaled, free, bounded), matrices.zeros(free.size, both.size, J)]]),
            D=matrices.block([[_part(scaled, bounded, free)], [matrices.zeros(both.size, free.size, J)]]),
            a=shifted[free],
            b=np.concatenate([shifted[bounded], ub[rows] - lb[rows]]),
        )
        return target, {"free": free, "bounded": bounded, "both": both, "c": c, "S": S, "M": M, "q": q}

    def lift(self, point: MLCPPoint, trace: Trace) -> MiCPPoint:
        z = np.array(trace["c"])
        bounded = trace["bounded"]
        z[trace["free"]] = point.u
        z[bounded] += trace["S"][bounded] * point.v[: bounded.size]
        return MiCPPoint(z=z)

    def push(self, point: MiCPPoint, trace: Trace) -> MLCPPoint:
        bounded, S = trace["bounded"], trace["S"]
        force = S * (trace["M"] @ point.z + trace["q"])
        y = np.maximum(-force[bounded][trace["both"]], 0.0)
        v = S[bounded] * (point.z - trace["c"])[bounded]
        return MLCPPoint(u=point.z[trace["free"]], v=np.concatenate([v, y]))


def _part(M: Matrix, rows: np.ndarray, columns: np.ndarray) -> Matrix:
    return sp.csr_array(matrices.sparse(M)[rows][:, columns])
