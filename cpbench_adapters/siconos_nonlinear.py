"""Base of Siconos' solvers of nonlinear problems. The guest evaluates F and its Jacobian from their operations, by
NumPy: an evaluation takes about 2 µs for every depth and operator, which on small problems is most of the time.

Where F is not a number they mostly end with info 2; but Siconos' error of a component is |z − max(0, z − w)|, and its
max of 0 and NaN is 0, so that z = 0 passes there (siconos-mcp-newton-min-fb on a Walras problem): a claim like any.

Siconos' errors are absolute there (the norm of F(0) of its variational inequalities is set to 1), and so is its
tolerance: no size of F at a start enters, which beside a pole may be anything. All start at the start that is given,
else at the problem's own, projected on its simple set.
"""

from __future__ import annotations

import dataclasses
from typing import Any

from cpbench.solvers.base import Budget, Record, SolverOutput
from cpbench.solvers.external.served import HandedOver
from cpbench_adapters.siconos import SiconosSolver
from cpbench_adapters.siconos_tolerances import MAP, ErrorTest

LARGEST = 1000
"""Unknowns: Siconos' Jacobians are dense, a solve with one of 1000 takes a third of a second."""


class SiconosNonlinear(SiconosSolver):
    """A solver that calls F back, and F′ unless it only projects."""

    test = ErrorTest("norm of the solver's own function of (z, F), absolute", MAP)

    def obstacle(self, problem: Any) -> str | None:
        n = problem.start.size
        if n > LARGEST:
            return f"n = {n}: Siconos' Jacobians are dense, at most {LARGEST} unknowns are handed over"
        return super().obstacle(problem)

    def solve(
        self, prepared: HandedOver, budget: Budget, options: Any, start: Any | None = None, record: Record | None = None
    ) -> SolverOutput:
        problem: Any = prepared.problem
        zero = problem.zero_point()
        first = dataclasses.replace(zero, z=problem.project(problem.start if start is None else start.z))
        return super().solve(prepared, budget, options, first, record)
