"""Semismooth Newton on the natural map between bounds: which of them are active, then the free unknowns at once."""

from __future__ import annotations

from functools import partial
from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.linear import AVI, Relay
from cpbench.foundation.cones import project_box
from cpbench.foundation.matrices import Vector, max_abs
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench.solvers.shared.jacobians import box_jacobian
from cpbench_solvers.avi.claims import error_of
from cpbench_solvers.nonlinear.natural_map import (
    AffineVI,
    NaturalMapNewton,
    NewtonOptions,
    ScaledVI,
    congruent,
    equilibrate,
)
from cpbench_solvers.traits import ITERATIVE


class _NewtonOnBox(NaturalMapNewton):
    """z ← at its bound where z − w is beyond it, and w_F = 0 for the others F: Newton on z − P(z − w).

    This is block principal pivoting for bounds, with a line search; projection and contraction take over where it
    does not descend. Converges from anywhere for monotone M; other M are tried.
    """

    def obstacle(self, problem: Relay | AVI) -> str | None:
        if isinstance(problem, AVI) and not problem.only_box:
            rows = problem.b.size + problem.d.size
            return f"has {rows} rows beside its bounds, whose set has no projection in closed form: use lemke-avi"
        return None

    def setup(self, problem: Relay | AVI, budget: Budget, options: NewtonOptions) -> ScaledVI:
        n = problem.q.size
        d = equilibrate(problem.M, np.arange(n))
        # what is fixed takes any force, and a large one must not set a scale
        weighed = d * np.where(problem.moving, problem.q, 0.0)
        forces = max_abs(weighed) or 1.0
        # bounds much nearer than the z that balances q are the better unit, as in `Relay.z_unit`
        width = max_abs(((problem.ub - problem.lb) / d)[problem.moving])
        size = min(forces, width) if width > 0 else forces
        unit = size * d
        lower, upper = problem.lb / unit, problem.ub / unit

        def answer(z: Vector) -> Any:
            return problem.point_from_vector(unit * z)

        vi = AffineVI(
            M=congruent(problem.M, d) * (size / forces),
            q=weighed / forces,
            project=lambda z: project_box(z, lower, upper),
            jacobian=lambda z: box_jacobian(z, lower, upper),
            answer=answer,
            error=lambda z: error_of(problem, answer(z), budget.tolerance),
        )
        return ScaledVI(vi, unit)


_spec = partial(
    SolverSpec,
    summary="semismooth Newton on the bounds, safeguarded by projection and contraction",
    method="semismooth Newton",
    citation="Pang 1990, Math. Oper. Res. 15:311; He 1997, Appl. Math. Optim. 35:69",
    traits=ITERATIVE,
    options=NewtonOptions,
)


@register
class NewtonRelay(_NewtonOnBox):
    """Newton's method between bounds."""

    spec: ClassVar[SolverSpec] = _spec(name="newton-relay", node="relay")


@register
class NewtonAVI(_NewtonOnBox):
    """Newton's method where there are bounds alone, whose projection is a formula."""

    spec: ClassVar[SolverSpec] = _spec(name="newton-avi", node="avi")
