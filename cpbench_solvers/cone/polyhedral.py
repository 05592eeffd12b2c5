"""The error of answers to cone problems whose cones have flat faces, by connected parts: that of a QP, or of an affine
inequality in a box."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from cpbench.formulations.avi import AVI
from cpbench.formulations.coneqp import ConeQP, ConeQPPoint
from cpbench.formulations.qp import QP
from cpbench.formulations.soclcp import SOCLCP, SOCLCPPoint
from cpbench.foundation.product_cones import Cone
from cpbench_solvers.avi.claims import error_of_parts
from cpbench_solvers.qp.claims import ErrorMeasure

KERNELS = ("qp_dense", "qp_sparse", "qp_parts", "qp_rows", "affine_parts", "affine_rows")
"""Compiled loops of the measures, which a warm-up loads: a solve that compiled them would run out of time."""
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


class PolyhedralPairs:
    """The same of a cone complementarity problem (`avi.claims`)."""

    def __init__(self, problem: SOCLCP) -> None:
        kind = np.repeat(problem.K.kind, problem.K.size.astype(int))
        lb, ub = np.where(kind == Cone.FREE, -np.inf, 0.0), np.where(kind == Cone.ZERO, 0.0, np.inf)
        self._problem = AVI(M=problem.M, q=problem.q, lb=lb, ub=ub)

    @classmethod
    def of(cls, problem: SOCLCP) -> PolyhedralPairs | None:
        """Return the measure of a problem; None where it has other cones."""
        return cls(problem) if np.isin(problem.K.kind, FLAT).all() else None

    def __call__(self, point: SOCLCPPoint) -> float:
        return error_of_parts(self._problem, point.x)


def judged(problem: ConeQP | SOCLCP, tolerance: float) -> Callable[[Any], float]:
    """Return what measures an answer: by norms (`residuals`), and where these are within the tolerance and all cones
    have flat faces, by connected parts."""

    @cache
    def of_parts() -> Callable[[Any], float] | None:
        return (PolyhedralError if isinstance(problem, ConeQP) else PolyhedralPairs).of(problem)

    def error(point: Any) -> float:
        found = problem.residuals(point, tolerance).error if point.finite else np.inf
        return max(found, parts(point)) if found <= tolerance and (parts := of_parts()) is not None else found

    return error
