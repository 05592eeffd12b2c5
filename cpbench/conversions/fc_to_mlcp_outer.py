"""Frictional contact → MLCP by a circumscribed polygon, outer facets given by their sides (equations (42)-(46)).

Source  u = Wr + q, Coulomb's law with the disk of radius μ r_N.
Target  r_T free; v = (r_N, κ ∈ ℝ^ν) a contact; the sides have the normals c_i at angle + 2πi/ν, C = [c_1 … c_ν]:
        u_T + Cκ = 0,  0 ≤ r_N ⟂ u_N ≥ 0,  0 ≤ κ ⟂ μ r_N e − Cᵀr_T ≥ 0.
Lift    r = (r_N, r_T).        Push  r_T projected on the polygon, κ on the two normals that enclose −u_T.
Kind    approximate: radius too large by up to 1/cos(π/ν) − 1, sliding direction off by up to 180°/ν.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from cpbench.conversions import facets as polygon
from cpbench.conversions.base import Conversion, Size, conversions
from cpbench.conversions.congruence import Congruence
from cpbench.conversions.operators import ContactOperator
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.formulations.mlcp import MLCP, MLCPPoint
from cpbench.foundation.matrices import Dense


@conversions.register("fc-mlcp-outer")
@dataclass(frozen=True)
class FCtoMLCPOuter(Conversion):
    """`facets` sides, the first touching the circle at `angle` [rad]. Trace: `W`, `q`, `mu`, for `push`."""

    name = "fc-mlcp-outer"
    source = "fc"
    target = "mlcp"
    equation = "(42)-(46)"
    kind = Kind.APPROXIMATE
    cost = 4.0

    facets: int = 8
    angle: float = 0.0

    @property
    def normals(self) -> Dense:
        """c_i as columns, shape (2, ν)."""
        return polygon.directions(self.facets, self.angle)

    def obstacle(self, problem: FrictionContact) -> str | None:
        return polygon.obstacle(problem, self.facets, self.angle)

    def apply(self, problem: FrictionContact) -> tuple[MLCP, Trace]:
        self.require(problem)
        W, q, mu = problem.W, problem.q, problem.mu
        every = polygon.coefficients(mu)
        A, B, C, D = (form.assemble(W, every) for form in self.congruences.values())
        u = q.reshape(-1, 3)
        b = np.zeros((problem.nc, self.facets + 1))
        b[:, 0] = u[:, 0]
        return MLCP(A=A, B=B, C=C, D=D, a=u[:, 1:].ravel(), b=b.ravel()), {"W": W, "q": q, "mu": mu}

    def operator(self, problem: FrictionContact) -> dict[str, ContactOperator]:
        """Return A, B, C and D of the MLCP, never assembled."""
        self.require(problem)
        every = polygon.coefficients(problem.mu)
        return {name: form.operator(problem.W, every) for name, form in self.congruences.items()}

    def predict(self, problem: FrictionContact) -> Size:
        parts = [form.size(problem.W) for form in self.congruences.values()]
        return Size(
            rows=problem.nc * (self.facets + 3),
            entries=sum(part.entries for part in parts),
            bytes=sum(part.bytes for part in parts),
        )

    @property
    def congruences(self) -> dict[str, Congruence]:
        """A, B, C and D, their coefficients at a contact 1 and μ."""
        tangential = np.eye(3)[:, 1:]  # r = tangential r_T + normal v
        normal = np.zeros((3, self.facets + 1))
        normal[0, 0] = 1.0
        sides = np.hstack([np.zeros((2, 1)), self.normals])
        friction = np.zeros((self.facets + 1, self.facets + 1))
        friction[1:, 0] = 1.0
        return {
            "A": Congruence(tangential, tangential, np.zeros((2, 2, 2))),
            "B": Congruence(normal, normal, np.stack([0.0 * friction, friction])),
            "C": Congruence(tangential, normal, np.stack([sides, 0.0 * sides])),
            "D": Congruence(normal, tangential, np.stack([-sides.T, 0.0 * sides.T])),
        }

    def lift(self, point: MLCPPoint, trace: Trace) -> FCPoint:
        normal = point.v.reshape(-1, self.facets + 1)[:, 0]
        return FCPoint(r=np.column_stack([normal, point.u.reshape(-1, 2)]).ravel())

    def push(self, point: FCPoint, trace: Trace) -> MLCPPoint:
        normal, r_T, velocity = polygon.split(point, trace, 3)
        half = math.pi / self.facets
        vertices = polygon.directions(self.facets, self.angle + half) / math.cos(half)
        inside = polygon.coordinates(r_T, vertices, trace["mu"] * normal) @ vertices.T
        kappa = polygon.coordinates(-velocity[:, 1:], self.normals)
        return MLCPPoint(u=inside.ravel(), v=np.column_stack([normal, kappa]).ravel())
