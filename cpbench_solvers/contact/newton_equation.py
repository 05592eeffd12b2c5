"""Φ(x) = 0 of frictional contact for Newton methods: which function, its Jacobian A + BW, and the directions."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg import lapack

from cpbench.foundation.factorization import DENSE_LIMIT, sparse_lu
from cpbench.foundation.matrices import Dense, Matrix, Vector, dense, norm
from cpbench_solvers.contact.sweeps import ScaledContacts
from cpbench_solvers.kernels import contact_newton

DENSE_FROM = 0.25
"""Share of entries from which a sparse W is factorized as a dense one."""


def factored_sparse(W: Matrix) -> bool:
    """Return whether factors of W are sparse: not of a small one, nor of a full one."""
    return sp.issparse(W) and W.shape[0] > DENSE_LIMIT and W.nnz <= DENSE_FROM * W.shape[0] ** 2


class ContactFunction(IntEnum):
    """Function that is 0 at a solution; the numbers are those of the kernel, which has the formulas."""

    ALART_CURNIER = 0
    NATURAL_MAP = 1


@dataclass(frozen=True, eq=False)
class NewtonPoint:
    """x with Φ there. x, phi : (nc·d,). A, B : (nc, d, d), ∂φ/∂x and ∂φ/∂v of every contact. moves : (nc,) whether φ is
    more than x. size : ‖Φ‖."""

    x: Vector
    phi: Vector
    A: Dense
    B: Dense
    moves: NDArray[np.bool_]
    size: float


class ContactEquation:
    """Φ of the problem in x = S⁻¹r with W′ = SWS, where ϱ is 1/W′_NN and 1 over the mean of W′_TT's diagonal, or 1 for
    the natural map, which has one ϱ. A zero of Φ solves the problem, whatever ϱ > 0.
    """

    def __init__(self, contacts: ScaledContacts, function: ContactFunction) -> None:
        problem, W = contacts.rows.problem, contacts.W
        self._kernel, self._function = contact_newton, int(function)
        self._mu, self._q = problem.mu, contacts.q
        d, nc = problem.dimension, problem.nc
        self._shape = (nc, d)
        self._alpha, self._centre = 0.0, contacts.q
        self._rho = np.ones((nc, 2))
        if function is ContactFunction.ALART_CURNIER:
            mobility = problem.mobility * (contacts.s**2).reshape(self._shape)
            mean = np.stack([mobility[:, 0], mobility[:, 1:].mean(axis=1)], axis=1)
            self._rho = np.where(mean > 0, 1.0 / np.where(mean > 0, mean, 1.0), 1.0)
        # 1/ϱ of every row
        self._mobility = 1.0 / np.repeat(self._rho, [1, d - 1], axis=1)
        self._dense = not sp.issparse(W) or W.nnz > DENSE_FROM * W.shape[0] ** 2
        self._W: Matrix = np.ascontiguousarray(dense(W)) if self._dense else W
        if not self._dense:
            # by columns of blocks, the diagonal ones among them
            pattern = sp.csr_array((np.zeros(nc), np.arange(nc), np.arange(nc + 1)), shape=(nc, nc))
            whole = sp.csr_array(sp.coo_array(W.T) + sp.kron(pattern + sp.eye_array(nc), np.zeros((d, d))))
            blocks = sp.bsr_array(whole, blocksize=(d, d))
            blocks.sort_indices()
            self._first, self._row = blocks.indptr.astype(np.int64), blocks.indices.astype(np.int64)
            self._blocks = np.ascontiguousarray(blocks.data.swapaxes(1, 2))

    def near(self, centre: Vector, alpha: float) -> ContactEquation:
        """Return the equation of W′ + αI and q′ − α·centre, of the proximal point of `centre`; shares the matrix."""
        other = copy.copy(self)
        other._alpha, other._centre = alpha, centre
        return other

    def at(self, x: Vector) -> NewtonPoint:
        nc, d = self._shape
        phi, moves = np.empty(nc * d), np.empty(nc, dtype=bool)
        A, B = np.empty((nc, d, d)), np.empty((nc, d, d))
        v = self._W @ x + self._q
        if self._alpha > 0.0:
            v += self._alpha * (x - self._centre)
        self._kernel.evaluate(self._function, x, v, self._mu, self._rho, phi, A, B, moves)
        if self._alpha > 0.0:  # ∂v/∂x is W′ + αI; the directions then only need to know of W′
            A += self._alpha * B
        return NewtonPoint(x, phi, A, B, moves, norm(phi))

    def jacobian(self, at: NewtonPoint, tau: float, contacts: NDArray[np.int64]) -> Dense | sp.csc_array:
        """Return an element of ∂Φ over some contacts, of W′ + τϱ⁻¹ in place of W′; dense or by compressed columns."""
        d, k = self._shape[1], contacts.size
        A = at.A + (tau * self._mobility)[:, None, :] * at.B
        if self._dense:
            J = np.empty((d * k, d * k))
            self._kernel.dense_jacobian(self._W, A, at.B, contacts, J)
            return J
        number = np.full(self._shape[0], -1)
        number[contacts] = np.arange(k)
        start = np.zeros(d * k + 1, dtype=np.int32)
        index, value = np.empty(self._blocks.size, dtype=np.int32), np.empty(self._blocks.size)
        place = (contacts, number, start, index, value)
        entries = self._kernel.sparse_jacobian(self._first, self._row, self._blocks, A, at.B, *place)
        return sp.csc_array((value[:entries], index[:entries], start), shape=(d * k, d * k))

    def direction(self, at: NewtonPoint, tau: float) -> Vector | None:
        """Return −J⁻¹Φ of W′ + τϱ⁻¹; None where the system is exactly singular.

        Contacts with φ = x have d = −x; the system is about the others.
        """
        d = -at.phi
        contacts = np.flatnonzero(at.moves)
        if contacts.size == 0:
            return d
        by_contact = d.reshape(self._shape)
        by_contact[contacts] = 0.0
        rest = (self._W @ d).reshape(self._shape) if contacts.size < self._shape[0] else np.zeros(self._shape)
        right = -at.phi.reshape(self._shape)[contacts]
        right -= np.einsum("cij,cj->ci", at.B[contacts], rest[contacts])
        with np.errstate(all="ignore"):
            part = _solved(self.jacobian(at, tau, contacts), right.ravel())
        if part is None:
            return None
        by_contact[contacts] = part.reshape(-1, self._shape[1])
        return d


def _solved(J: Any, right: Vector) -> Vector | None:
    if sp.issparse(J):
        factors = sparse_lu(J, symmetric_structure=True)
        x = None if factors is None else factors.solve(right)
        return x if x is not None and np.isfinite(x).all() else None
    lu, pivots, info = lapack.dgetrf(J.T, overwrite_a=True)  # J lies by rows: Fortran's order without a copy
    if info != 0:
        return None
    x = lapack.dgetrs(lu, pivots, right, trans=1, overwrite_b=True)[0]
    return x if np.isfinite(x).all() else None
