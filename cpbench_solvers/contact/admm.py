"""ADMM on frictional contact: a linear solve, the projection on the cones, De Saxcé's shift of the iterate before."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, cast

import numpy as np
import scipy.sparse as sp
from scipy.linalg import lapack

from cpbench.foundation.matrices import Matrix, Vector, factor_on_diagonal
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_solvers.cone.law_admm import LONGER, RHO
from cpbench_solvers.cone.penalty import TINY, StepPenalty
from cpbench_solvers.contact.by_parts import contact_spec
from cpbench_solvers.contact.run import ContactMethod, ContactSolver, MethodOptions
from cpbench_solvers.contact.sweeps import ScaledContacts
from cpbench_solvers.kernels import contact_splitting


@dataclass(frozen=True)
class ADMMContactOptions(MethodOptions):
    """Options of admm-fc. `rho` : the first penalty, in units where every W_cc has mean diagonal 1. `alpha` :
    over-relaxation. `balance` : adapt ρ to the residuals. `stall_window` : iterations without gain after which it gives
    up."""

    rho: float = 0.1
    alpha: float = 1.0
    balance: bool = True
    max_iterations: int = 20_000


class ContactSplitting(ContactMethod):
    """The iterates of one run, `step` by step."""

    def __init__(
        self, contacts: ScaledContacts, options: ADMMContactOptions, start: Vector, budget: Budget | None = None
    ) -> None:
        self._contacts, self._options = contacts, options
        problem = contacts.rows.problem
        self._mu, self._d = problem.mu, problem.dimension
        self._advance = contact_splitting.advance
        self._penalty = StepPenalty(options.rho, *RHO, LONGER, options.balance)
        self._factors: Factors | None = None
        self._sizes, self._shift = np.zeros(4), np.zeros(problem.nc)
        self._z, self._xi = start / contacts.s, np.zeros(contacts.q.size)
        self._q_size = float(np.linalg.norm(contacts.q))
        self.counters = {"factorizations": 0, "projections": 0, "matrix_vector_products": 1}
        if start.any():
            shape = (problem.nc, problem.dimension)
            hat = problem.law.shift((contacts.W @ self._z + contacts.q).reshape(shape))
            dual = hat + problem.law.project(-hat)  # on K*, Moreau
            self._xi = -dual.ravel() / options.rho
            self._shift = problem.mu * np.linalg.norm(dual[:, 1:], axis=1)

    @property
    def r(self) -> Vector:
        """Reactions in their cones."""
        return self._contacts.s * self._z

    @property
    def entries(self) -> int:
        """Number of entries of the factors; 0 before the first step and after a change of ρ."""
        return 0 if self._factors is None else self._factors.entries

    def step(self, many: int = 1, error: float = math.inf, seconds: float = math.inf) -> str | None:
        """Make one iteration."""
        rho = self._penalty.rho
        if self._factors is None:
            self._factors = _factors(self._contacts.W, rho)
            self.counters["factorizations"] += 1
            if self._factors is None:
                return f"W + ρI is singular for ρ = {rho:.1e}"
        right = rho * (self._z - self._xi) - self._contacts.q
        right[:: self._d] -= self._shift
        x = self._factors.solve(right)
        self._advance(x, self._mu, rho, self._options.alpha, self._d, self._z, self._xi, self._shift, self._sizes)
        self.counters["projections"] += self._mu.size
        self.counters["matrix_vector_products"] += 1
        if self._penalty.due():
            apart, moved, size, xi = (math.sqrt(value) for value in self._sizes)
            change = self._penalty.follow(apart / max(size, TINY), moved / max(xi, self._q_size / rho, TINY))
            if change != 1.0:
                self._xi *= change
                self._factors = None
        return None


@dataclass(frozen=True)
class Factors:
    """Factors of a matrix A: a function from b (n,) to A⁻¹b (n,), and the number of their entries."""

    solve: Callable[[Vector], Vector]
    entries: int


def _factors(W: Matrix, rho: float) -> Factors | None:
    """Return factors of W + ρI; None where it is exactly singular, which no monotone W is."""
    if sp.issparse(W):
        lu = factor_on_diagonal(W + rho * sp.eye_array(W.shape[0], format="csr"))
        return None if lu is None else Factors(lu.solve, int(lu.nnz))
    lu, pivots, info = cast(Any, lapack.dgetrf)(W + rho * np.eye(W.shape[0]), overwrite_a=True)
    return None if info > 0 else Factors(lambda b: cast(Any, lapack.dgetrs)(lu, pivots, b)[0], W.size)


@register
class ADMMContact(ContactSolver):
    """(W′ + ρI) x = −q′ − μ‖u_T‖e_N + ρ(z − ξ), z = P_K(x + ξ), ξ ← ξ + x − z; at rest û′ = −ρξ ∈ K*.

    One factorization for each ρ, which follows the ratio of primal and dual residual, less often every time.
    Converges for a shift held fixed and W ⪰ 0; with the moving one in practice, also where contacts are hyperstatic.
    """

    spec: ClassVar[SolverSpec] = contact_spec(
        name="admm-fc",
        summary="ADMM with self-adapting penalty on the De Saxcé-shifted cone problem",
        method="operator splitting",
        citation="Acary, Bourrier and Viennet 2023, hal-03978387; Boyd et al. 2011, section 3.4.1",
        options=ADMMContactOptions,
    )
    method: ClassVar[Any] = ContactSplitting
