"""ADMM on contact in global form without condensation: the dynamics, joints and contacts in one sparse linear system.

(HᵀK⁻¹H + ρI) x = right − q is solved as

    ⎡ M   −G  −H′ ⎤ ⎡v⎤   ⎡ f      ⎤
    ⎢ Gᵀ   0   0  ⎥ ⎢λ⎥ = ⎢ −b     ⎥ ,   H′ = H diag(s), w′ = diag(s) w,
    ⎣ H′ᵀ  0   ρI ⎦ ⎣x⎦   ⎣ right − w′⎦

so that W = HᵀK⁻¹H, which has an entry for any two contacts that a chain of bodies joins, is never formed.
"""

from __future__ import annotations

from functools import partial
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.global_contact import GFCPoint, GlobalContact
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Matrix, Vector, block, identity, max_abs, sparse, transpose, zeros
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_solvers.cone.law_admm import ConicADMM, ConicADMMOptions, Delassus
from cpbench_solvers.contact.global_parts import SolverByMovingParts
from cpbench_solvers.traits import ITERATIVE

RELAXED, REFINEMENTS = 1e-8, 3
"""δ over the inverse of the largest mass, where K is singular, and solutions that then take it back."""


class Dynamics(Delassus):
    """W and q by the saddle-point matrix K = [[M, −G], [Gᵀ, 0]] of the problem."""

    def __init__(self, problem: GlobalContact) -> None:
        self.problem, self.dimension = problem, problem.dimension
        self.law = problem.law.in_units(problem.lengths)
        self.s = np.sqrt(problem.effective_mass)
        M, H, G = problem.M, problem.H, problem.G
        self._corner: Matrix = zeros(problem.b.size, problem.b.size, G)
        self._saddle = problem.saddle
        if problem.b.size and self._saddle.singular:  # joints that say the same: λ is made unique by a little of it
            self._corner = _times(RELAXED / max_abs(M), identity(problem.b.size, G))
            self._saddle = Factorization(block([[M, -G], [transpose(G), self._corner]]))
        D = sp.diags_array(self.s)
        self._columns: Matrix = sp.csr_array(sparse(H) @ D) if sp.issparse(H) else np.asarray(H * self.s)
        self._free = self.s * (problem.H.T @ self._motion(np.zeros_like(self.s))[0] + problem.w)

    def factorize(self, rho: float) -> None:
        problem, H = self.problem, self._columns
        n, p, m = problem.f.size, problem.b.size, problem.w.size
        rows: list[list[Matrix | None]] = [
            [problem.M, -problem.G, -H],
            [transpose(problem.G), self._corner, zeros(p, m, H)],
            [transpose(H), zeros(m, p, H), _times(rho, identity(m, H))],
        ]
        if not p:
            rows = [[problem.M, -H], [transpose(H), _times(rho, identity(m, H))]]
        self._factors = Factorization(block(rows))
        self._load = np.concatenate([problem.f, -problem.b, -self.s * problem.w])
        self._x = slice(n + p, n + p + m)

    def resolvent(self, right: Vector) -> Vector:
        load = self._load.copy()
        load[self._x] += right
        return np.asarray(self._factors.solve(load))[self._x]

    def velocity(self, x: Vector) -> Vector:
        if not x.any():
            return self._free
        return self.s * (self.problem.H.T @ self._motion(self.s * x)[0] + self.problem.w)

    def point(self, r: Vector) -> GFCPoint:
        """Return the answer that these reactions make."""
        v, lam = self._motion(r)
        return GFCPoint(v=v, r=r, lam=lam)

    def _motion(self, r: Vector) -> tuple[Vector, Vector]:
        """Return v and λ for given reactions."""
        problem = self.problem
        n = problem.f.size
        load = np.concatenate([problem.f + problem.H @ r, -problem.b])
        solution = np.asarray(self._saddle.solve(load))
        if self._saddle is not problem.saddle:  # the joints as they are: Gᵀv + δ(λ − λ of before) = −b
            for _ in range(REFINEMENTS):
                load[n:] = self._corner @ solution[n:] - problem.b
                solution = np.asarray(self._saddle.solve(load))
        return solution[:n], solution[n:]


def _times(factor: float, A: Matrix) -> Matrix:
    return sp.csr_array(factor * A) if sp.issparse(A) else factor * A


class GlobalADMM(SolverByMovingParts):
    """The iteration of `law_admm`; velocities and joint reactions follow from the reactions exactly."""

    def obstacle(self, problem: GlobalContact) -> str | None:
        return "M is singular: velocities do not follow from reactions" if problem.factorization.singular else None

    def prepare(self, problem: GlobalContact, budget: Budget, options: ConicADMMOptions) -> Dynamics:
        return Dynamics(problem)

    def method(self, prepared: Dynamics, budget: Budget, options: ConicADMMOptions, r: Vector) -> ConicADMM:
        return ConicADMM(prepared, options, r, budget)


_spec = partial(
    SolverSpec,
    method="operator splitting",
    citation="Acary, Bourrier and Viennet 2023, hal-03978387; Boyd et al. 2011, section 3.4.1",
    traits=ITERATIVE,
    options=ConicADMMOptions,
)


@register
class ADMMGlobal(GlobalADMM):
    """Coulomb friction on the dynamics themselves, without condensation."""

    spec: ClassVar[SolverSpec] = _spec(
        name="admm-gfc", node="gfc", summary="ADMM with self-adapting penalty on the dynamics, without condensation"
    )


@register
class ADMMGlobalRolling(GlobalADMM):
    """Rolling friction on the dynamics themselves, without condensation."""

    spec: ClassVar[SolverSpec] = _spec(
        name="admm-grfc", node="grfc", summary="ADMM with self-adapting penalty on the dynamics with rolling friction"
    )
