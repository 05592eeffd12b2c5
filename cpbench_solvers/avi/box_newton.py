"""Semismooth Newton between bounds, on the function of Fischer and Burmeister."""

from __future__ import annotations

from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np

from cpbench.formulations.linear import AVI, Relay
from cpbench.formulations.ncp_functions import fischer_burmeister
from cpbench.foundation.matrices import Matrix, Vector, dense, max_abs
from cpbench.solvers.base import Budget, Record, Solver, SolverOutput, SolverSpec, register
from cpbench_solvers.avi.claims import error_of
from cpbench_solvers.nonlinear.box_newton import DENSE_LIMIT, LinearBox, run
from cpbench_solvers.nonlinear.semismooth_newton import SemismoothMethod, SemismoothOptions
from cpbench_solvers.qp.scaling import congruent, equilibrate
from cpbench_solvers.traits import ITERATIVE


class AffineBox(NamedTuple):
    """Data in units in which the largest entries of M, and of w and z in a solution, are about 1; z is `unit` times
    that of the data."""

    problem: Relay | AVI
    M: Matrix
    q: Vector
    unit: Vector


class _NewtonOnBox(Solver):
    """Newton's method on the function of Fischer and Burmeister, which is its own merit; for two bounds as Billups
    composes it. Steps of an active set (min instead) take half of the steps on obstacles, and five times as many on
    sparse monotone M without symmetry.

    Where the matrix is singular: that of M with a shifted diagonal, Levenberg and Marquardt's direction, the gradient,
    in the end other starts.
    """

    def obstacle(self, problem: Relay | AVI) -> str | None:
        if isinstance(problem, AVI) and not problem.only_box:
            rows = problem.b.size + problem.d.size
            return f"has {rows} rows beside its bounds, whose set has no projection in closed form: use lemke-avi"
        return None

    def setup(self, problem: Relay | AVI, budget: Budget, options: SemismoothOptions) -> AffineBox:
        n = problem.q.size
        M = dense(problem.M) if n <= DENSE_LIMIT else problem.M
        d = equilibrate(M, np.arange(n))
        # what is fixed takes any force, and a large one must not set a scale
        weighed = d * np.where(problem.moving, problem.q, 0.0)
        forces = max_abs(weighed) or 1.0
        # bounds much nearer than the z that balances q are the better unit, as in `Relay.z_unit`
        width = max_abs(((problem.ub - problem.lb) / d)[problem.moving])
        size = min(forces, width) if width > 0 else forces
        return AffineBox(problem, congruent(M, d) * (size / forces), weighed / forces, size * d)

    def solve(
        self,
        prepared: AffineBox,
        budget: Budget,
        options: SemismoothOptions,
        start: Any = None,
        record: Record | None = None,
    ) -> SolverOutput:
        problem, M, q, unit = prepared

        def answer(z: Vector) -> Any:
            return problem.point_from_vector(unit * z)

        def error(z: Vector, tolerance: float) -> float:
            return error_of(problem, answer(z), tolerance)

        box = LinearBox(M, q, problem.lb / unit, problem.ub / unit, answer, error)
        method = SemismoothMethod(box, fischer_burmeister, fischer_burmeister, options)
        limit = budget.iterations or options.max_iterations
        return run(method, budget, limit, options.restarts, None if start is None else start.vector / unit, record)


_spec = partial(
    SolverSpec,
    summary="semismooth Newton on the Fischer-Burmeister equation of the bounds, nonmonotone line search",
    method="semismooth Newton",
    citation="Billups 1995; De Luca, Facchinei and Kanzow 1996, Math. Program. 75",
    traits=ITERATIVE,
    options=SemismoothOptions,
)


@register
class NewtonRelay(_NewtonOnBox):
    """Newton's method between bounds."""

    spec: ClassVar[SolverSpec] = _spec(name="newton-relay", node="relay")


@register
class NewtonAVI(_NewtonOnBox):
    """Newton's method where there are bounds alone."""

    spec: ClassVar[SolverSpec] = _spec(name="newton-avi", node="avi")
