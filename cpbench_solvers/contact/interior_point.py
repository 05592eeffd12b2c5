"""Primal-dual interior points on frictional contact, scaled as Nesterov and Todd do, with De Saxcé's term.

In units where every W_cc has mean diagonal 1 and the tangential components are divided by μ the cones are Lorentz's L:
x = Ty, T = diag(1, μ, μ), and De Saxcé's term μ‖u_T‖ is ‖w_T‖ of the dual w = Tû itself. Find y, w ∈ int L with

    TWTy + Tq + φ(w) e_N − w = 0,   y ∘ w = σ e → 0,   φ(w) = √(‖w_T‖² + ε²), ε ~ σ

by Newton's method. With Θy = w, Θ = P(p)⁻¹ at the scaling point p, the second line gives dw = c − Θdy, and

    (TWT + (I − e_N φ′)Θ) dy = −residual + (I − e_N φ′) c,

a matrix as sparse as W, for a predictor (σ = 0) and Mehrotra's corrector. With φ the problem is not convex, and
convergence is a matter of experience.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias, cast

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg import lapack

from cpbench.foundation.factorization import sparse_lu
from cpbench.foundation.matrices import EPS, Dense, Matrix, Vector, dense, max_abs, scaled_both, with_diagonal
from cpbench.solvers.base import Budget, SolverSpec, register
from cpbench_solvers.contact.by_parts import contact_spec
from cpbench_solvers.contact.newton_equation import factored_sparse
from cpbench_solvers.contact.run import ContactMethod, ContactSolver, MethodOptions
from cpbench_solvers.contact.sweeps import ScaledContacts
from cpbench_solvers.kernels import contact_interior

SHORTEST = 1e-8
"""A step shorter than this means that the iterates are stuck at the boundary."""


@dataclass(frozen=True)
class ContactInteriorPointOptions(MethodOptions):
    """Options of interior-point-fc. `boundary` : share of the way to the boundary that a
    step goes. `smoothing` : ε, in units of max|q|, over yᵀw/nc in those of its square. `max_iterations`."""

    boundary: float = 0.7
    smoothing: float = 0.1
    max_iterations: int = 300
    stall_window: int = 30


class ContactInteriorPoint(ContactMethod):
    """Interior points of one problem, step by step."""

    def __init__(
        self, contacts: ScaledContacts, options: ContactInteriorPointOptions, start: Vector, budget: Budget
    ) -> None:
        problem = contacts.rows.problem
        self._options, self._d, self._nc = options, problem.dimension, problem.nc
        T = np.ones((problem.nc, self._d))
        T[:, 1:] = problem.mu[:, None]
        self._unit, self._start, self._begun = contacts.s * T.ravel(), start, False
        self._matrix = _matrix(
            with_diagonal(scaled_both(contacts.W, T.ravel()), np.where(T.ravel() == 0.0, 1.0, 0.0)), *T.shape
        )
        self._q = np.ascontiguousarray(T * contacts.q.reshape(T.shape))
        self._size, self._largest = max_abs(self._q) or 1.0, max_abs(self._matrix.W)
        self.y, self.w = np.zeros(T.shape), np.zeros(T.shape)
        self.y[:, 0] = self.w[:, 0] = self._size
        nc, d = T.shape
        self._kernel = contact_interior
        self._scaling, self._slope, self._c = np.empty((nc, 2 * d + 1)), np.empty((nc, d)), np.empty((nc, d))
        self._residual, self._right, self._blocks = np.empty(nc * d), np.empty(nc * d), np.empty((nc, d, d))
        self.counters = {"factorizations": 0}

    @property
    def r(self) -> Vector:
        return self._unit * self.y.ravel() if self._begun else self._start

    def step(self, many: int, error: float, seconds: float) -> str | None:
        self._begun = True
        y, w, kernel, scaling, slope, c = self.y, self.w, self._kernel, self._scaling, self._slope, self._c
        residual, right, matrix = self._residual, self._right, self._matrix
        gap = float(np.vdot(y, w)) / self._nc
        if not gap > 0.0:
            return "the iterates have left the cones"
        epsilon = self._options.smoothing * gap / self._size
        Wy = matrix.W @ y.ravel()
        kernel.prepare(y, w, self._q, Wy, epsilon, scaling, slope, residual, self._blocks)
        self.counters["factorizations"] += 1
        solve = matrix.factors(self._blocks)
        if solve is None:
            return "the linear system is singular"
        kernel.predict(w, slope, residual, c, right)
        kernel.correct(y, w, scaling, slope, residual, solve(right), gap, c, right)
        length = kernel.move(y, w, scaling, c, solve(right), self._options.boundary, SHORTEST)
        if np.isnan(length):
            return "the linear system is singular"
        # u = Wr + q is rounding from here on, so that no error of it says anything
        if EPS * max_abs(y) * self._largest >= self._size:
            return "the reactions have grown until u is rounding: there may be no solution"
        return None if length >= SHORTEST else f"steps of length {length:.0e}"


Solve: TypeAlias = Callable[[Vector], Vector]


@dataclass(frozen=True)
class _DenseMatrix:
    """W, dense, to which blocks on the diagonal are added."""

    W: Dense

    def factors(self, blocks: Dense) -> Solve | None:
        """Return what solves with W + blocks, None where that is singular."""
        nc, d, _ = blocks.shape
        whole, c = np.array(self.W), np.arange(nc)
        whole.reshape(nc, d, nc, d)[c, :, c, :] += blocks
        # the transpose of what lies by rows lies by columns, as LAPACK wants it
        lu, pivots, info = cast(Any, lapack.dgetrf)(whole.T, overwrite_a=True)
        return None if info > 0 else lambda b: cast(Any, lapack.dgetrs)(lu, pivots, b, trans=1)[0]


@dataclass(frozen=True)
class _SparseMatrix:
    """W by columns, with all entries of its diagonal blocks, and where these lie in its data: `place` (nc, d, d)."""

    W: sp.csc_array
    position: NDArray[np.int64]

    @classmethod
    def of(cls, W: Matrix, nc: int, d: int) -> _SparseMatrix:
        blocks = sp.kron(sp.eye_array(nc), np.ones((d, d)), format="coo")
        whole = sp.coo_array(W)
        places = (np.concatenate([own, more]) for own, more in zip(whole.coords, blocks.coords, strict=True))
        # stored zeros stay
        row, column = places
        csc = sp.csc_array((np.concatenate([whole.data, np.zeros(blocks.nnz)]), (row, column)), shape=W.shape)
        csc.sum_duplicates()
        row, column = csc.indices, np.repeat(np.arange(nc * d), np.diff(csc.indptr))
        inside = np.flatnonzero(row // d == column // d)
        position = np.empty((nc, d, d), np.int64)
        position[row[inside] // d, row[inside] % d, column[inside] % d] = inside
        return cls(csc, position)

    def factors(self, blocks: Dense) -> Solve | None:
        """Return what solves with W + blocks, None where that is singular."""
        data = self.W.data.copy()
        data[self.position] += blocks
        lu = sparse_lu(
            sp.csc_array((data, self.W.indices, self.W.indptr), shape=self.W.shape), symmetric_structure=True
        )
        return None if lu is None else lu.solve


def _matrix(W: Matrix, nc: int, d: int) -> _DenseMatrix | _SparseMatrix:
    if factored_sparse(W):
        return _SparseMatrix.of(W, nc, d)
    return _DenseMatrix(np.ascontiguousarray(dense(W)))


@register
class InteriorPointContact(ContactSolver):
    """The whole law, De Saxcé's term in every Newton step with its derivative. A start is returned where it is right,
    and otherwise not used: the middle of the cones is a better place to begin."""

    spec: ClassVar[SolverSpec] = contact_spec(
        name="interior-point-fc",
        summary="nonconvex primal-dual interior point with De Saxcé's term",
        method="interior point",
        citation="Acary, Armand, Nguyen and Shpakovych 2024; Nesterov and Todd 1998; Mehrotra 1992",
        options=ContactInteriorPointOptions,
    )
    method: ClassVar[Any] = ContactInteriorPoint
