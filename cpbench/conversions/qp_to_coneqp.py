"""QP → cone QP: inequalities are a nonnegative orthant, equalities the zero cone.

Source  min ½zᵀQz + pᵀz  subject to  Az ≥ b (λ),  Cz = d (μ),  lb ≤ z ≤ ub (ν).
Target  the same objective over [E; F]z − (e, g) ∈ ℝ₊ × {0}, with the finite bounds among the rows E, e and F, g (as in
        qp-mlcp).
Lift    z and the multipliers y, sorted out to λ, μ, ν.        Push  the same, backwards.
Kind    equivalent, for any Q: objective and feasible set are the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.conversions import kkt
from cpbench.conversions.base import Conversion, conversions
from cpbench.formulations.base import Kind, Trace
from cpbench.formulations.coneqp import ConeQP, ConeQPPoint
from cpbench.formulations.qp import QP, QPPoint
from cpbench.foundation import matrices
from cpbench.foundation.product_cones import Cone, ProductCone


@conversions.register("qp-coneqp")
@dataclass(frozen=True)
class QPtoConeQP(Conversion):
    """Rows in a product of two cones. Trace: as qp-mlcp."""

    name = "qp-coneqp"
    source = "qp"
    target = "coneqp"
    equation = "(1)"
    kind = Kind.EQUIVALENT
    cost = 1.0

    def apply(self, problem: QP) -> tuple[ConeQP, Trace]:
        rows = kkt.rows(problem, problem.Q)
        target = ConeQP.over(
            (problem.Q + matrices.transpose(problem.Q)) * 0.5,
            problem.p,
            ProductCone.of((Cone.NONNEGATIVE, 1, rows.e.size), (Cone.ZERO, 1, rows.g.size)),
            matrices.block([[rows.E], [rows.F]]),
            -np.concatenate([rows.e, rows.g]),
        )
        return target, {**rows.sizes, "inequalities": rows.e.size}

    def lift(self, point: ConeQPPoint, trace: Trace) -> QPPoint:
        inequality, equality = np.split(point.y, [trace["inequalities"]])
        lam, mu, nu = kkt.split(inequality, equality, trace)
        return QPPoint(z=point.x, lam=lam, mu=mu, nu=nu)

    def push(self, point: QPPoint, trace: Trace) -> ConeQPPoint:
        return ConeQPPoint(x=point.z, y=np.concatenate(kkt.join(point.lam, point.mu, point.nu, trace)))
