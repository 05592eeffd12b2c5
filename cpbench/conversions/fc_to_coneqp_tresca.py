"""Frictional contact → convex QP over cylinders, friction thresholds frozen (Tresca).

Source  u = Wr + q, contact law with −u_T ∈ N_{D(μ r_N)}(r_T),  W symmetric.
Target  min ½rᵀWr + qᵀr over r ∈ Π ℝ₊ × D(g_c), with g_c given for μ_c r_Nc.
Lift    r.        Push  r, y = Wr + q.
Kind    relaxation: the threshold no longer follows the normal reaction; one step of the fixed point g_c = μ_c r_Nc
        (Nečas, Jarušek, Haslinger 1980). Not given, g_c is μ_c max(−q_N, 0)/W_NN, the threshold of a contact alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions import frozen
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.coneqp import ConeQP, ConeQPPoint
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.foundation.matrices import Vector
from cpbench.foundation.product_cones import Cone, ProductCone


@conversions.register("fc-coneqp-tresca")
@dataclass(frozen=True)
class FCtoConeQPTresca(Conversion):
    """`threshold`: g_c [N s], one number a contact. Trace: `W`, `q`."""

    name = "fc-coneqp-tresca"
    source = "fc"
    target = "coneqp"
    equation = "Tresca"
    kind = Kind.RELAXATION
    cost = 4.0

    threshold: tuple[float, ...] = ()

    def obstacle(self, problem: FrictionContact) -> str | None:
        instead = "no conversion without a gradient leads to coneqp"
        return frozen.wrong_count("threshold", self.threshold, problem) or frozen.asymmetric("W", problem.W, instead)

    def apply(self, problem: FrictionContact) -> tuple[ConeQP, Trace]:
        self.require(problem)
        g = np.array(self.threshold) if self.threshold else _alone(problem)
        K = ProductCone.of((Cone.CYLINDER, problem.nc, problem.dimension, g))
        return ConeQP.over(problem.W, problem.q, K), {"W": problem.W, "q": problem.q}

    def lift(self, point: ConeQPPoint, trace: Trace) -> FCPoint:
        return FCPoint(r=point.x)

    def push(self, point: FCPoint, trace: Trace) -> ConeQPPoint:
        return ConeQPPoint(x=point.r, y=trace["W"] @ point.r + trace["q"])


def _alone(problem: FrictionContact) -> Vector:
    """Return μ_c times the normal reaction that stops contact c without the others; 0 where W_NN is not positive."""
    normal = problem.diagonal_blocks[:, 0, 0]
    closing = np.maximum(-problem.q[:: problem.dimension], 0.0)
    return problem.mu * np.divide(closing, normal, out=np.zeros_like(closing), where=normal > 0)
