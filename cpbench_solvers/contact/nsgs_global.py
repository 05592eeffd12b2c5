"""Nonsmooth Gauss–Seidel on contact in global form: contact after contact on the velocities of the bodies.

W = HᵀM⁻¹H is never formed. With M = LLᵀ and A = L⁻¹H a contact reads its velocity from the bodies it touches, is solved
exactly, and moves these bodies: a sweep costs two passes over A, whatever number of contacts a body has.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.global_contact import GFCPoint, GlobalFrictionContact
from cpbench.foundation.factorization import Blocks, assembled, components, diagonal_blocks
from cpbench.foundation.matrices import Dense, Matrix, Sparse, Vector, dense, entries, freeze, sparse
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_solvers.contact.global_parts import SolverByMovingParts
from cpbench_solvers.contact.run import ContactMethod, MethodOptions
from cpbench_solvers.kernels import block_layout, velocity_sweeps
from cpbench_solvers.traits import ITERATIVE

LARGEST = 256
"""Unknowns of M that may hang together: a contact moves all those of the bodies that it touches."""


def whitening(M: Sparse) -> Sparse:
    """Return L⁻¹ of M = LLᵀ by components of M; raises numpy.linalg.LinAlgError when one is not positive definite."""
    parts = diagonal_blocks(M, LARGEST)
    lower = [Blocks(part.unknowns, np.tril(np.linalg.inv(np.linalg.cholesky(part.values)))) for part in parts]
    return assembled(lower, M.shape)


def _whitened(problem: GlobalFrictionContact) -> tuple[Matrix, Matrix]:
    """Return L⁻¹ and Aᵀ of A = L⁻¹H."""
    if problem.small:
        M, H, _ = problem.at_hand
        inverse = np.asarray(np.tril(np.linalg.inv(np.linalg.cholesky(dense(M)))), np.float64)
        return inverse, (inverse @ dense(H)).T
    lower = whitening(sparse(problem.M))
    rows = sp.csr_array((lower @ sparse(problem.H)).T)
    rows.sort_indices()
    return lower, rows


@dataclass(frozen=True)
class Bodies:
    """A by contacts: `start`, `unknown`, `A` of the kernel; y of r = 0; and what the one-contact problem needs."""

    problem: GlobalFrictionContact
    start: Any
    unknown: Any
    A: Vector
    free: Vector
    diagonal: Dense
    local: Dense

    @classmethod
    def of(cls, problem: GlobalFrictionContact) -> Bodies:
        d, nc = problem.dimension, problem.nc
        layout = block_layout
        inverse, rows = _whitened(problem)
        indptr, indices, data = entries(rows)
        start = np.zeros(nc + 1, np.uint64)
        if nc:
            layout.count(indptr, indices, 1, False, start)
        unknown, A = np.empty(int(start[-1]), np.uint32), np.zeros(d * int(start[-1]))
        D, local = np.empty((nc, d, d)), np.empty((nc, 12 if d == 3 else 0))
        if nc:
            layout.fill(indptr, indices, data, 1, False, 1, 0, start, unknown, A)
        velocity_sweeps.diagonal_blocks(start, A, D)
        if d == 3:
            layout.one_contact_constants(D, local)
        return cls(problem, start, unknown, A, inverse @ problem.f, freeze(D.reshape(nc, d * d)), local)

    def point(self, r: Vector) -> GFCPoint:
        """Return the answer that these reactions make."""
        problem = self.problem
        return GFCPoint(v=np.asarray(problem.factorization.solve(problem.f + problem.at_hand[1] @ r)), r=r)


class VelocitySweeps(ContactMethod):
    """Sweeps in pieces, every one from the velocities that belong to its reactions."""

    pieces: ClassVar[bool] = True

    def __init__(self, bodies: Bodies, r: Vector) -> None:
        self._bodies, self._r, self._lam = bodies, r, np.zeros(bodies.problem.nc)
        self.counters = {"projections": 0}

    @property
    def r(self) -> Vector:
        return self._r.copy()

    def step(self, many: int, error: float, seconds: float) -> str | None:
        bodies, problem, kernels = self._bodies, self._bodies.problem, velocity_sweeps
        y, matrix = bodies.free.copy(), (bodies.start, bodies.unknown, bodies.A)
        kernels.push(*matrix, self._r, problem.dimension, y)
        law = (problem.w, problem.mu, problem.rho, self._r)
        if problem.dimension == 3:
            kernels.sweeps_3d(*matrix, bodies.diagonal, bodies.local, *law, self._lam, y, many)
        else:
            kernels.sweeps_2d(*matrix, bodies.diagonal, *law, y, many)
        self.counters["projections"] += many * problem.nc
        return None


@register
class NSGSGlobal(SolverByMovingParts):
    """Block Gauss–Seidel with exact one-contact solves on the dynamics; the iterates are those of `nsgs` on W.

    M must be symmetric positive definite with small components (rigid bodies, robots); there must be no joints.
    """

    spec: ClassVar[SolverSpec] = SolverSpec(
        name="nsgs-gfc",
        node="gfc",
        summary="nonsmooth Gauss-Seidel on the velocities of the bodies, without condensation",
        method="splitting",
        citation="Jean 1999, CMAME 177:235; Erleben 2007, ACM Trans. Graph. 26(2):12",
        traits=ITERATIVE,
        options=MethodOptions,
    )

    def obstacle(self, problem: GlobalFrictionContact) -> str | None:
        if problem.b.size:
            return "joints: a contact moves more than the bodies that it touches"
        if not problem.factorization.symmetric:
            return "M is not symmetric"
        M = sparse(problem.M)
        largest = int(components(M)[1].max(initial=0))
        if largest > LARGEST:
            return f"{largest} unknowns of M hang together, more than {LARGEST}"
        try:
            whitening(M)
        except np.linalg.LinAlgError:
            return "M is not positive definite"
        return None

    def prepare(self, problem: GlobalFrictionContact, budget: Budget, options: MethodOptions) -> Bodies:
        return Bodies.of(problem)

    def method(self, prepared: Bodies, budget: Budget, options: MethodOptions, r: Vector) -> VelocitySweeps:
        return VelocitySweeps(prepared, r)
