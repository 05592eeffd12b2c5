"""Semismooth Newton on an LCP: ψ(z_i, w_i) = 0 for one of three NCP functions, made global by the merit ½‖Φ‖².

The steps, the line search and what is done where a Jacobian is singular (Levenberg and Marquardt's regularization, the
gradient of the merit, in the end other starts) are those of the nonlinear problems; the matrix is dense (LAPACK) or
sparse (SuperLU). `regularized` counts the steps that were not Newton's.

Reference in plain NumPy: `tests/solvers/references/newton_min.py`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.formulations.ncp_functions import NCPFunction, fischer_burmeister, minimum, penalized
from cpbench.foundation.matrices import Matrix, Vector, identity
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, register
from cpbench_solvers.lcp.claims import (
    ScaledLCP,
    conclude,
    dense_obstacle,
    error_of,
    guessed,
    recorded,
    scale,
    settled,
    solve_linear,
)
from cpbench_solvers.nonlinear.box_newton import DENSE_LIMIT, LinearBox, run
from cpbench_solvers.nonlinear.semismooth_newton import SemismoothMethod, SemismoothOptions
from cpbench_solvers.traits import ITERATIVE

SHIFT = 1e-10
"""Added to the diagonal of a singular Jacobian; the largest entry of M is 1."""


@dataclass(frozen=True)
class NewtonLCPOptions(SemismoothOptions):
    """Options of Newton's methods, as for nonlinear problems."""

    max_iterations: int = 500
    restarts: int = 5


class LCPBox(LinearBox):
    """F(z) = Mz + q of a scaled LCP on z ≥ 0."""

    def __init__(self, prepared: ScaledLCP) -> None:
        problem, unit = prepared.problem, prepared.z_unit
        lb, ub = np.zeros(prepared.q.size), np.full(prepared.q.size, np.inf)
        super().__init__(
            prepared.M, prepared.q, lb, ub, lambda z: LCPPoint(z * unit), lambda z, t: error_of(problem, z * unit, t)
        )

    def solve(self, A: Matrix, b: Vector) -> Vector | None:
        """Return A⁻¹b by LU, whatever the condition: the line search tells what that is worth. An exactly singular A
        gets a multiple of I, which for monotone problems is enough."""
        self.counters["factorizations"] += 1
        x = solve_linear(A, b)
        if x is None:
            self.counters["regularized"] += 1
            x = solve_linear(A + SHIFT * identity(b.size, A), b)
        return x


class _NewtonLCP(Solver):
    """Base of the methods, which differ in the function whose zeros they look for."""

    psi: ClassVar[NCPFunction]
    merit: ClassVar[NCPFunction]
    """Another function where ½‖Φ‖² of the first has kinks."""

    def obstacle(self, problem: LCP) -> str | None:
        return None if sp.issparse(problem.M) else dense_obstacle(problem)

    def setup(self, problem: LCP, budget: Budget, options: NewtonLCPOptions) -> ScaledLCP:
        return scale(problem, keep_sparse=problem.q.size > DENSE_LIMIT)

    def solve(
        self,
        prepared: ScaledLCP,
        budget: Budget,
        options: NewtonLCPOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        method = SemismoothMethod(LCPBox(prepared), type(self).psi, type(self).merit, options)
        limit = budget.iterations or options.max_iterations
        first = None if start is None else start.z / prepared.z_unit
        output = run(method, budget, limit, options.restarts, first, record)
        if output.claim is not Claim.SOLVED or output.point is None:
            return output
        z, counters = output.point.z, dict(output.counters)
        active = guessed(prepared, z / prepared.z_unit)
        better, error = settled(prepared.problem, z, active, budget.tolerance, counters)
        concluded = conclude(prepared.problem, better, budget, counters, error=error)
        return recorded(concluded, z, prepared.problem, record, counters["iterations"] + 1)


_spec = partial(SolverSpec, node="lcp", method="semismooth Newton", traits=ITERATIVE, options=NewtonLCPOptions)


@register
class NewtonMin(_NewtonLCP):
    """Steps to the basic solution of {w < z}, finite on P-problems near it; the merit is Fischer and Burmeister's."""

    psi = staticmethod(minimum)
    merit = staticmethod(fischer_burmeister)
    spec: ClassVar[SolverSpec] = _spec(
        name="newton-min",
        summary="semismooth Newton on min(z, w), merit of Fischer-Burmeister, nonmonotone line search",
        citation="Kummer 1988; Harker and Pang 1990; De Luca, Facchinei and Kanzow 2000, Comput. Optim. Appl. 16:173",
        quick=True,
    )


@register
class NewtonFB(_NewtonLCP):
    """Newton's method on z + w − √(z² + w²): a smooth merit, for P₀-matrices stationary in solutions only."""

    psi = merit = staticmethod(fischer_burmeister)
    spec: ClassVar[SolverSpec] = _spec(
        name="newton-fb",
        summary="semismooth Newton on the Fischer-Burmeister equation, nonmonotone line search",
        citation="De Luca, Facchinei and Kanzow 1996, Math. Program. 75:407",
    )


@register
class NewtonPFB(_NewtonLCP):
    """Newton's method on the penalized function: bounded level sets if M is monotone with an interior point."""

    psi = merit = staticmethod(penalized)
    spec: ClassVar[SolverSpec] = _spec(
        name="newton-pfb",
        summary="semismooth Newton on the penalized Fischer-Burmeister equation, nonmonotone line search",
        citation="Chen, Chen and Kanzow 2000, Math. Program. 88:211",
        by_default=False,
    )
