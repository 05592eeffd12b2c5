"""Semismooth Newton on an MLCP: Au + Cv + a = 0 and ψ(v, w) = 0, made global by the merit ½‖Φ‖²."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.linear import MLCP
from cpbench.formulations.ncp_functions import NCPFunction, fischer_burmeister, minimum
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, register
from cpbench_solvers.mlcp.claims import ScaledMLCP, conclude, dense_obstacle, scale, settled
from cpbench_solvers.nonlinear.box_newton import DENSE_LIMIT, LinearBox, run
from cpbench_solvers.nonlinear.semismooth_newton import SemismoothMethod, SemismoothOptions
from cpbench_solvers.traits import ITERATIVE


def linear_box(prepared: ScaledMLCP) -> LinearBox:
    """Return Kx + k of a scaled MLCP, its first unknowns free, the others ≥ 0."""
    lb = np.where(np.arange(prepared.k.size) < prepared.free, -np.inf, 0.0)
    return LinearBox(prepared.K, prepared.k, lb, np.full(lb.size, np.inf), prepared.point, prepared.error)


class _NewtonMLCP(Solver):
    """Base of the methods, which differ in the function whose zeros they look for."""

    psi: ClassVar[NCPFunction]

    def obstacle(self, problem: MLCP) -> str | None:
        sparse = all(not isinstance(M, np.ndarray) for M in (problem.A, problem.B, problem.C, problem.D))
        return None if sparse else dense_obstacle(problem)

    def setup(self, problem: MLCP, budget: Budget, options: SemismoothOptions) -> ScaledMLCP:
        return scale(problem, keep_sparse=problem.a.size + problem.b.size > DENSE_LIMIT)

    def solve(
        self,
        prepared: ScaledMLCP,
        budget: Budget,
        options: SemismoothOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        method = SemismoothMethod(linear_box(prepared), type(self).psi, fischer_burmeister, options)
        limit = budget.iterations or options.max_iterations
        first = None if start is None else prepared.start(start)
        output = run(method, budget, limit, options.restarts, first, record)
        if output.claim is not Claim.SOLVED or output.point is None:
            return output
        x = prepared.start(output.point)
        better, least = settled(prepared, x, prepared.error(x), budget.tolerance)
        if record is not None and better is not x:
            record(output.counters["iterations"] + 1, least, partial(prepared.point, better))
        concluded = conclude(prepared, better, budget, output.counters, error=least)
        return replace(concluded, point=output.point if better is x else concluded.point)


_spec = partial(SolverSpec, node="mlcp", method="semismooth Newton", traits=ITERATIVE, options=SemismoothOptions)


@register
class NewtonMinMLCP(_NewtonMLCP):
    """Steps to the basic solution of {w < v}; the merit is Fischer and Burmeister's. Where the matrix of that basis is
    singular: Levenberg and Marquardt's direction, the gradient, in the end other starts."""

    psi = staticmethod(minimum)
    spec: ClassVar[SolverSpec] = _spec(
        name="newton-min-mlcp",
        summary="semismooth Newton on min(v, w), merit of Fischer-Burmeister, nonmonotone line search",
        citation="De Luca, Facchinei and Kanzow 2000, Comput. Optim. Appl. 16",
    )


@register
class NewtonFBMLCP(_NewtonMLCP):
    """Newton's method on the function of Fischer and Burmeister, whose merit is differentiable."""

    psi = staticmethod(fischer_burmeister)
    spec: ClassVar[SolverSpec] = _spec(
        name="newton-fb-mlcp",
        summary="semismooth Newton on the Fischer-Burmeister equation, nonmonotone line search",
        citation="De Luca, Facchinei and Kanzow 1996, Math. Program. 75; Billups 1995",
    )
