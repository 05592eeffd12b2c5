"""ADMM of Pinocchio on frictional contact, with a proximal term and OSQP's rule for ρ.

Splits r = x = y: x from the damped linear system (W + ρτ + μ_prox) x = …, y from the projection on the cones, z → û.
De Saxcé's term μ‖z_T‖ is that of the iterate before, so that the fixed point obeys Coulomb's law.

Tolerance ε: Pinocchio stops when max|x − y|, ρ max|Δx| and every |z_cᵀy_c| are at most ε/10 in scaled data
(`pinocchio_contacts`), or at once when the start fulfils the law that well. The claim is Pinocchio's own word.
It knows no time limit; that of the budget is kept from outside.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.contact import FCPoint
from cpbench.formulations.local_contact import FrictionContact
from cpbench.solvers.base import Budget, Claim, Record, Solver, SolverOutput, SolverSpec, Trait, register
from cpbench.solvers.stopping import Stopping
from cpbench_adapters import pinocchio_contacts
from cpbench_adapters.pinocchio_contacts import PinocchioContacts

SHARE = 0.1
"""Part of our tolerance that its criteria get: they look at one component or contact at a time, ours at all."""
LARGEST_DENSE = 11_585
"""Rows up to which a dense W, its copy and its factor (1 GB each) are made."""
BEFORE_THE_LOOP = 1
"""Factorizations when the start was good enough."""


@dataclass(frozen=True)
class PinocchioADMMOptions:
    """Options of pinocchio-admm. `anderson` : iterates that Anderson's acceleration looks back on, 0 for none.
    `max_iterations` : the most. `lanczos` : vectors for the largest eigenvalue of W, from which the first ρ is made;
    Pinocchio's default, as many as rows, takes 2.4 s of 2.5 on 1350.
    """

    anderson: int = 0
    max_iterations: int = 100_000
    lanczos: int = 100


@register
class PinocchioADMM(Solver):
    """One factorization for each ρ; a sparse W is factorized as such."""

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="pinocchio-admm",
        node="fc",
        summary="alternating directions with an adaptive penalty on contacts, Pinocchio",
        method="operator splitting",
        citation="Carpentier, Le Lidec and Montaut, RSS 2024: From compliant to rigid contact simulation",
        requires=("pinocchio",),
        install="pip install pin",
        licence="BSD-3-Clause",
        traits=frozenset({Trait.SPARSE, Trait.WARM_START, Trait.DETERMINISTIC}),
        options=PinocchioADMMOptions,
        known_failures={"check_claims_hold_in_other_units": "claims a fast contact at error 8.6e-6, in any unit"},
    )

    def obstacle(self, problem: FrictionContact) -> str | None:
        if problem.q.size > LARGEST_DENSE and not sp.issparse(problem.W):
            return f"W is dense and has {problem.q.size} rows > {LARGEST_DENSE}; give it sparse"
        return pinocchio_contacts.obstacle(problem)

    def stopping(self, tolerance: float, problem: FrictionContact | None = None) -> Stopping:
        test = "max|x − y|, ρ max|Δx| and every |z_cᵀy_c|, of scaled data"
        return pinocchio_contacts.stopping(test, SHARE * tolerance)

    def setup(self, problem: FrictionContact, budget: Budget, options: PinocchioADMMOptions) -> PinocchioContacts:
        return pinocchio_contacts.contacts(problem)

    def solve(
        self,
        prepared: PinocchioContacts,
        budget: Budget,
        options: PinocchioADMMOptions,
        start: Any | None = None,
        record: Record | None = None,
    ) -> SolverOutput:
        import pinocchio as pin

        n = prepared.g.size
        if n == 0:
            return SolverOutput(claim=Claim.SOLVED, point=FCPoint(np.zeros(0)), counters={"iterations": 0})
        settings, result = pin.ADMMSolverSettings(), pin.ADMMSolverResult()
        pinocchio_contacts.set_tolerances(settings, self.stopping(budget.tolerance))
        settings.anderson_capacity = options.anderson
        settings.lanczos_size = options.lanczos
        limit = budget.iterations or options.max_iterations
        settings.max_iterations = limit - 1  # its loop has one more
        if start is not None:
            result.setConstraintImpulseGuess(prepared.guess(start.r))
        # the operator keeps the damping of a run: each has its own
        operator = pin.DelassusOperatorSparse if sp.issparse(prepared.G) else pin.DelassusOperatorDense
        converged = pin.ADMMConstraintSolver(n).solve(
            operator(prepared.G), prepared.g, prepared.models, prepared.data, settings, result
        )
        factorizations = int(result.delassus_decomposition_update_count)
        iterations = 0 if factorizations == BEFORE_THE_LOOP else min(int(result.iterations) + 1, limit)
        counters = {"iterations": iterations, "factorizations": factorizations}
        x = np.array(result.retrieveConstraintImpulses())
        if not np.isfinite(x).all():
            return SolverOutput(claim=Claim.FAILED, counters=counters, message=f"not finite after {iterations}")
        return SolverOutput(
            claim=Claim.SOLVED if converged else Claim.MAX_ITER,
            point=FCPoint(prepared.reactions(x)),
            counters=counters,
            message=f"primal {result.primal_feasibility:.1e}, dual {result.dual_feasibility:.1e}, "
            f"complementarity {result.complementarity:.1e}, rho {result.rho:.1e}",
        )

    def warmup(self) -> None:
        self.run(FrictionContact(W=np.eye(3), q=np.array([-1.0, 0.0, 0.0]), mu=np.array([0.5])))
