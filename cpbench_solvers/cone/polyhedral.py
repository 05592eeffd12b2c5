"""The error of answers to cone programs whose cones have flat faces, by connected parts: that of a QP."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.coneqp import ConeQP, ConeQPPoint
from cpbench.formulations.qp import QP
from cpbench.foundation.product_cones import Cone
from cpbench_solvers.qp.claims import ErrorMeasure

KERNELS = ("qp_dense", "qp_sparse", "qp_parts", "qp_rows")
"""Compiled loops of the measure, which a warm-up loads: a solve that compiled them would run out of time."""
FLAT = (Cone.ZERO, Cone.FREE, Cone.NONNEGATIVE)


class PolyhedralError:
    """The largest error of a connected part, as the verdict has it (`qp_rows`): norms over all hide small ones."""

    def __init__(self, problem: ConeQP) -> None:
        kind = np.repeat(problem.K.kind, problem.K.size.astype(int))
        rows, equations, self._free = (np.flatnonzero(kind == c) for c in (Cone.NONNEGATIVE, Cone.ZERO, Cone.FREE))
        self._inequalities, self._equations = rows, equations
        program = QP.build(
            problem.Q, problem.p, problem.A[rows], -problem.b[rows], problem.A[equations], -problem.b[equations]
        )
        self._measure, self._none = ErrorMeasure(program), np.zeros(problem.p.size)

    @classmethod
    def of(cls, problem: ConeQP) -> PolyhedralError | None:
        """Return the measure of a problem; None where it has other cones."""
        return cls(problem) if np.isin(problem.K.kind, FLAT).all() else None

    def __call__(self, point: ConeQPPoint) -> float:
        if point.y[self._free].any():
            return np.inf
        return self._measure.of_parts((point.x, point.y[self._inequalities], point.y[self._equations], self._none))
