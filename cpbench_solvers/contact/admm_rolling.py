"""ADMM on contacts with rolling friction in local form."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.local_contact import RollingFrictionContact
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Vector, identity, scaled_both
from cpbench.solvers.base import Budget, Record, SolverOutput, SolverSpec, register
from cpbench_solvers.cone.law_admm import ConicADMM, ConicADMMOptions, Delassus
from cpbench_solvers.contact.by_parts import SolverByParts
from cpbench_solvers.contact.run import iterate_on
from cpbench_solvers.traits import ITERATIVE


class _Local(Delassus):
    def __init__(self, problem: RollingFrictionContact) -> None:
        self.problem, self.dimension = problem, problem.dimension
        self.law = problem.law.in_units(problem.lengths)
        self.s = np.sqrt(problem.effective_mass)
        self._W, self._q = scaled_both(problem.W, self.s), self.s * problem.q

    def factorize(self, rho: float) -> None:
        self._factors = Factorization(self._W + rho * identity(self._q.size, self._W))

    def resolvent(self, right: Vector) -> Vector:
        return np.asarray(self._factors.solve(right - self._q))

    def velocity(self, x: Vector) -> Vector:
        return self._W @ x + self._q


@register
class RollingADMM(SolverByParts):
    """(W′ + ρI) x = −q′ − (μ‖u_T‖ + μ_r‖ω‖)e_N + ρ(z − ξ), z = P_K(x + ξ), ξ ← ξ + x − z.

    Converges for a shift held fixed and W ⪰ 0; with the moving one in practice, also where contacts are hyperstatic.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="admm-rfc",
        node="rfc",
        summary="ADMM with self-adapting penalty on rolling friction",
        method="operator splitting",
        citation="Acary and Bourrier 2021, Eur. J. Mech. A/Solids 85:104046; Acary, Bourrier and Viennet 2023, "
        "hal-03978387",
        traits=ITERATIVE,
        options=ConicADMMOptions,
    )

    def prepare(self, problem: RollingFrictionContact, budget: Budget, options: ConicADMMOptions) -> _Local:
        return _Local(problem)

    def solve_part(
        self, prepared: _Local, budget: Budget, options: ConicADMMOptions, start: Any, record: Record | None
    ) -> SolverOutput:
        problem = prepared.problem
        r = np.zeros(problem.q.size) if start is None else np.array(start.r)

        def measured(point: FCPoint) -> float:
            return problem.residuals(point, budget.tolerance).error

        method = ConicADMM(prepared, options, r, budget)
        return iterate_on(measured, FCPoint, method, budget, options, record)
