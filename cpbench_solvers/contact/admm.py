"""ADMM on frictional contact: a linear solve, the projection on the cones, De Saxcé's shift of the iterate before."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, cast

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack

from cpbench.errors import NotApplicable
from cpbench.formulations.contact import FCPoint
from cpbench.formulations.fc import FrictionContact
from cpbench.foundation.definite import By, Factors, definite_factors
from cpbench.foundation.matrices import Matrix, Vector, is_symmetric
from cpbench.solvers.base import Budget, Claim, Record, SolverOutput, SolverSpec, register
from cpbench.solvers.shared.progress import Progress
from cpbench_solvers.contact.by_parts import SolverByParts
from cpbench_solvers.contact.sweeps import ScaledContacts, conclude, kernel, scaled_contacts
from cpbench_solvers.traits import ITERATIVE

FIRST_REST, LONGER = 20, 1.5
"""Iterations with one ρ before it may change, and by how much longer it must stay the next time."""
UNBALANCED, LARGEST_CHANGE = 3.0, 30.0
"""ρ changes by a factor between these, or not at all."""
RHO = (1e-9, 1e6)
TINY = 1e-300
"""Keeps from dividing by nothing."""


@dataclass(frozen=True)
class ADMMContactOptions:
    """Options of admm-fc. `rho` : the first penalty, in units where every W_cc has mean diagonal 1. `alpha` :
    over-relaxation. `balance` : adapt ρ to the residuals. `factors` : of sparse W + ρI; CHOLMOD and QDLDL take W for
    symmetric. `stall_window` : iterations without gain after which it gives up."""

    rho: float = 0.1
    alpha: float = 1.0
    balance: bool = True
    factors: Literal["superlu", "cholmod", "qdldl"] = "superlu"
    max_iterations: int = 20_000
    stall_window: int = 2_000


@register
class ADMMContact(SolverByParts):
    """(W′ + ρI) x = −q′ − μ‖u_T‖e_N + ρ(z − ξ), z = P_K(x + ξ), ξ ← ξ + x − z; at rest û′ = −ρξ ∈ K*.

    One factorization for each ρ, which follows the ratio of primal and dual residual, less often every time.
    Converges for a shift held fixed and W ⪰ 0; with the moving one in practice, also where contacts are hyperstatic.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="admm-fc",
        node="fc",
        summary="ADMM with self-adapting penalty on the De Saxcé-shifted cone problem",
        method="operator splitting",
        citation="Acary, Bourrier and Viennet 2023, hal-03978387; Boyd et al. 2011, section 3.4.1",
        traits=ITERATIVE,
        options=ADMMContactOptions,
    )

    def prepare(self, problem: FrictionContact, budget: Budget, options: ADMMContactOptions) -> ScaledContacts:
        if options.factors != "superlu" and not is_symmetric(problem.W):
            raise NotApplicable(self.spec.name, f"W is not symmetric, and {options.factors} reads a triangle of it")
        return scaled_contacts(problem)

    def warmup(self) -> None:
        for d in (2, 3):
            q = np.zeros(d)
            q[0] = -1.0
            self.run(FrictionContact(W=np.eye(d), q=q, mu=np.array([0.5]), dimension=d))

    def solve_part(
        self, prepared: ScaledContacts, budget: Budget, options: ADMMContactOptions, start: Any, record: Record | None
    ) -> SolverOutput:
        problem = prepared.rows.problem
        run = ContactSplitting(prepared, options, None if start is None else start.r)
        limit = budget.iterations or options.max_iterations
        deadline, progress = time.monotonic() + budget.seconds, Progress(options.stall_window)
        best, least = run.r, prepared.rows.judged_error(run.r)
        claim, message = Claim.MAX_ITER, f"{limit} iterations"
        if record is not None:
            record(0, least, lambda: FCPoint(best))
        while not least <= budget.tolerance and run.iterations < limit:
            if not run.step():
                claim, message = Claim.FAILED, f"W + ρI is singular for ρ = {run.rho:.1e}"
                break
            r = run.r
            error = prepared.rows.judged_error(r)
            if error < least:
                best, least = r, error
                if record is not None:
                    record(run.iterations, error, lambda now=r: FCPoint(now))
            why = progress.trouble(run.iterations, error)
            if why is None and time.monotonic() > deadline:
                why = f"out of time after {run.iterations} iterations"
            if why is not None:
                claim, message = Claim.FAILED, why
                break
        counters = {
            "iterations": run.iterations,
            "factorizations": run.factorizations,
            "projections": run.iterations * problem.nc,
            "matrix_vector_products": run.iterations + 1,
        }
        return conclude(problem, best, least, budget, claim, message, counters)


class ContactSplitting:
    """The iterates of one run; `step` may be called for as long as one likes."""

    def __init__(self, contacts: ScaledContacts, options: ADMMContactOptions, start: Vector | None) -> None:
        self._contacts, self._options = contacts, options
        problem = contacts.rows.problem
        self._mu, self._d = problem.mu, problem.dimension
        self._advance = kernel("contact_splitting").advance
        self.rho, self.iterations, self.factorizations = options.rho, 0, 0
        self._factors: Factors | None = None
        self._rest, self._since = float(FIRST_REST), 0
        self._sizes, self._shift = np.zeros(4), np.zeros(problem.nc)
        self._z, self._xi = np.zeros(contacts.q.size), np.zeros(contacts.q.size)
        self._q_size = float(np.linalg.norm(contacts.q))
        if start is not None:
            shape = (problem.nc, problem.dimension)
            self._z = start / contacts.s
            hat = problem.law.shift((contacts.W @ self._z + contacts.q).reshape(shape))
            dual = hat + problem.law.project(-hat)  # on K*, Moreau
            self._xi = -dual.ravel() / self.rho
            self._shift = problem.mu * np.linalg.norm(dual[:, 1:], axis=1)

    @property
    def r(self) -> Vector:
        """Reactions in their cones."""
        return self._contacts.s * self._z

    @property
    def entries(self) -> int:
        """Number of entries of the factors; 0 before the first step, where ρ has just changed, and where it is not
        known."""
        return 0 if self._factors is None else self._factors.entries or 0

    def step(self) -> bool:
        """Make one iteration; False where the linear system has no solution."""
        if self._factors is None:
            self._factors = _factors(self._contacts.W, self.rho, self._options.factors)
            self.factorizations += 1
            if self._factors is None:
                return False
        right = self.rho * (self._z - self._xi) - self._contacts.q
        right[:: self._d] -= self._shift
        x = self._factors.solve(right)
        self._advance(x, self._mu, self.rho, self._options.alpha, self._d, self._z, self._xi, self._shift, self._sizes)
        self.iterations += 1
        self._since += 1
        if self._options.balance and self._since >= self._rest:
            self._balance()
        return True

    def _balance(self) -> None:
        """Multiply ρ by √(primal/dual), both relative to what they are made of (Wohlberg 2017, arXiv:1704.06209)."""
        apart, moved, x, xi = (math.sqrt(value) for value in self._sizes)
        primal, dual = apart / max(x, TINY), moved / max(xi, self._q_size / self.rho, TINY)
        factor = math.sqrt(max(primal, TINY) / max(dual, TINY))
        factor = min(max(factor, 1.0 / LARGEST_CHANGE), LARGEST_CHANGE)
        if max(factor, 1.0 / factor) < UNBALANCED:
            return
        rho = min(max(self.rho * factor, RHO[0]), RHO[1])
        self._xi *= self.rho / rho
        self.rho, self._factors = rho, None
        self._rest, self._since = LONGER * self._rest, 0


def _factors(W: Matrix, rho: float, by: By) -> Factors | None:
    """Return factors of W + ρI; None where it is exactly singular, which no monotone W is."""
    if sp.issparse(W):
        return definite_factors(W + rho * sp.eye_array(W.shape[0], format="csr"), by)
    lu, pivots, info = cast(Any, lapack.dgetrf)(W + rho * np.eye(W.shape[0]), overwrite_a=True)
    return None if info > 0 else Factors(lambda b: cast(Any, lapack.dgetrs)(lu, pivots, b)[0], W.size)
