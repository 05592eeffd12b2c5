"""Convex problems over the cones or cylinders of contacts, in units where every W_cc has mean diagonal 1.

Two methods bring x near the solution: projected gradients with Nesterov's momentum, for symmetric W, and projected
Gauss–Seidel, for any.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.contact import diagonal_blocks
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector
from cpbench_solvers.contact.sweeps import ScaledContacts
from cpbench_solvers.kernels import frozen_contact

AT_ONCE = 10
"""Iterations or sweeps between two measurements."""
ROUNDING = 1e-15
"""A gap below which no iteration means anything."""


class FrozenProblem:
    """min ½xᵀWx + pᵀx over sets that follow x only when told so. `x` is moved in place.

    Attributes
    ----------
    u : Wx + q, without what is frozen, shape (nc, d), of the last measurement. counters : iterations of the methods.
    """

    def __init__(self, contacts: ScaledContacts, x: Vector, *, momentum: bool) -> None:
        problem = contacts.rows.problem
        self.d, self.mu, self.q = problem.dimension, problem.mu, contacts.q
        self._kernel = frozen_contact
        self._matrix = block_csr(contacts)
        self._momentum = momentum and matrices.is_symmetric(contacts.W)
        self.x, self._Wx = x, np.zeros_like(x)
        self._z, self._Wz, self._work = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
        self._state = np.array([1.0, 1.0])
        self._blocks: Any = None
        self.counters = {"inner_iterations": 0, "matrix_vector_products": 0}

    @property
    def X(self) -> Any:
        """x by contacts."""
        return self.x.reshape(-1, self.d)

    @property
    def u(self) -> Any:
        """Wx + q by contacts."""
        self._kernel.product(*self._matrix, self.d, self.x, self._Wx)
        return (self._Wx + self.q).reshape(-1, self.d)

    def minimize(self, kind: int, shift: Vector, radius: Vector, gap: float, most: int, deadline: float) -> None:
        """Iterate until the natural map of the frozen problem is at most `gap`, relative to its terms.

        Parameters
        ----------
        kind : of the sets, see the kernel. shift : added to q_N, (nc,). radius : of the disks, (nc,).
        most : iterations. deadline : of `time.monotonic`.
        """
        p = self.q.copy()
        p[:: self.d] += shift
        law = (kind, p, self.mu, radius, self.d)
        done = 0
        measured = self._kernel.gap(*self._matrix, *law, self.x, self._Wx, self._work)
        self._z[:], self._Wz[:], self._state[0] = self.x, self._Wx, 1.0
        while measured > max(gap, ROUNDING) and done < most and time.monotonic() < deadline:
            self._advance(law, AT_ONCE)
            done += AT_ONCE
            measured = self._kernel.gap(*self._matrix, *law, self.x, self._Wx, self._work)
        self.counters["inner_iterations"] += done

    def _advance(self, law: tuple[Any, ...], count: int) -> None:
        if self._momentum:
            moved = (self.x, self._Wx, self._z, self._Wz)
            products = self._kernel.accelerate(*self._matrix, *law, *moved, self._state, count)
        else:
            if self._blocks is None:
                self._blocks = _local(self._matrix, self.d)
            self._kernel.sweeps(*self._matrix, *self._blocks, *law, self.x, count)
            products = count
        self.counters["matrix_vector_products"] += int(products) + 1


def block_csr(contacts: ScaledContacts) -> tuple[Any, Any, Vector]:
    """Return W′ by rows of blocks with the diagonal ones, as the kernels of the projected methods read it."""
    d = contacts.rows.problem.dimension
    if not contacts.q.size:
        return np.zeros(1, np.int64), np.zeros(0, np.int64), np.zeros(0)
    W = sp.bsr_array(contacts.W, blocksize=(d, d))
    W.sort_indices()
    return W.indptr.astype(np.int64), W.indices.astype(np.int64), np.ascontiguousarray(W.data).ravel()


def _local(matrix: tuple[Any, Any, Vector], d: int) -> tuple[Vector, Vector]:
    """Return diagonal blocks and safe step lengths of the contacts."""
    start, column, blocks = matrix
    W = sp.bsr_array((blocks.reshape(-1, d, d), column, start), shape=2 * (d * (start.size - 1),))
    D = diagonal_blocks(sp.csr_array(W), d)
    largest = np.linalg.norm(D, ord=2, axis=(1, 2))
    return D.ravel(), np.where(largest > 0, 1.0 / np.where(largest > 0, largest, 1.0), 1.0)
