"""Semismooth Newton on the natural map of a cone LCP, for nonsymmetric M too."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from cpbench.formulations.conic import SOCLCP, SOCLCPPoint
from cpbench.foundation.matrices import Vector, max_abs
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench.solvers.shared.jacobians import projection_jacobian
from cpbench_solvers.cone.scaled_form import judged
from cpbench_solvers.nonlinear.natural_map import (
    AffineVI,
    NaturalMapNewton,
    NewtonOptions,
    ScaledVI,
    congruent,
    equilibrate,
)
from cpbench_solvers.traits import ITERATIVE


@register
class NewtonCone(NaturalMapNewton):
    """Newton steps on x − P_K(x − w) with exact Jacobians; projection and contraction where they do not descend.

    Converges from anywhere for monotone M, to a solution if there is one; other M are tried, and what comes out is
    claimed only as far as it was measured.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="newton-soclcp",
        node="soclcp",
        summary="semismooth Newton on the natural map of a cone, safeguarded by projection and contraction",
        method="semismooth Newton",
        citation="Qi and Sun 1993, Math. Program. 58:353; He 1997, Appl. Math. Optim. 35:69",
        traits=ITERATIVE,
        quick=True,
        options=NewtonOptions,
    )

    def setup(self, problem: SOCLCP, budget: Budget, options: NewtonOptions) -> ScaledVI:
        K = problem.K
        d = equilibrate(problem.M, K.blocks)
        # where K is {0}, F does not depend on q, and a large force there must not set a scale
        weighed = d * np.where(K.extended, problem.q, 0.0)
        size = max_abs(weighed) or 1.0
        unit = size * d

        error = judged(problem, budget.tolerance)

        def answer(x: Vector) -> SOCLCPPoint:
            return SOCLCPPoint(unit * x)

        vi = AffineVI(
            M=congruent(problem.M, d),
            q=weighed / size,
            project=K.project,
            jacobian=lambda x: projection_jacobian(K, x),
            answer=answer,
            error=lambda x: error(answer(x)),
        )
        return ScaledVI(vi, unit)
