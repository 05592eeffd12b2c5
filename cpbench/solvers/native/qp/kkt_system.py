"""The linear systems of the interior point method for QPs: [[H + diag(w), Gᵀ], [G, −diag(θ)]] with ever new w, θ ≥ 0.

Static regularization makes the matrix quasi-definite, so that every order of pivots is stable enough for refinement,
which takes it out again (Vanderbei 1995, SIAM J. Optim. 5:100).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.linalg import blas, lapack
from scipy.sparse import csgraph

from cpbench import matrices
from cpbench.kernel_cache import load
from cpbench.matrices import Dense, Matrix, Vector, max_abs

REFINEMENTS = 4
ACCURATE = 1e-9
"""What is left of a right-hand side, relative to it, that needs no further refinement."""
DENSE_SHARE = 0.6
"""A column of the factor that has this share of all rows below it begins the dense rest."""
CHEAP = 3e6
"""So many operations of a factorization are less than what it takes to find a better order than Cuthill and McKee's."""
LEAST_TAIL = 80
"""Rows that are worth a dense rest."""


class KKT(ABC):
    """H (n, n), G (r, n); `delta` : the regularization."""

    def __init__(self, H: Matrix, G: Matrix, delta: float) -> None:
        self.H, self.G, self.delta = H, G, delta
        self.Gt: Matrix = matrices.transpose(G)
        self.n = H.shape[0]

    def factor(self, w: Vector, theta: Vector) -> bool:
        """Factor; return False where it breaks down."""
        self.w, self.theta = w, theta
        return bool(np.isfinite(w).all() and np.isfinite(theta).all()) and self._factor()

    @abstractmethod
    def _factor(self) -> bool: ...

    @abstractmethod
    def apply(self, a: Vector, b: Vector) -> tuple[Vector, Vector]:
        """Return (dx, v) of the regularized system."""

    def solve(self, a: Vector, b: Vector) -> tuple[Vector, Vector]:
        """Return (dx, v), refined while that helps."""
        size = max(max_abs(a), max_abs(b))
        x, v = self.apply(a, b)
        left = self._left(a, b, x, v)
        error = max(max_abs(left[0]), max_abs(left[1]))
        for _ in range(REFINEMENTS):
            if not error > ACCURATE * size:
                break
            dx, dv = self.apply(*left)
            better = x + dx, v + dv
            left = self._left(a, b, *better)
            now = max(max_abs(left[0]), max_abs(left[1]))
            if not now < error:
                break
            (x, v), error = better, now
        return x, v

    def _left(self, a: Vector, b: Vector, x: Vector, v: Vector) -> tuple[Vector, Vector]:
        return a - self.H @ x - self.w * x - self.Gt @ v, b - self.G @ x + self.theta * v


class DenseKKT(KKT):
    """Cholesky of H + diag(w) + G_Iᵀ diag(1/θ) G_I, rows with θ = 0 by the Schur complement."""

    def __init__(self, H: Dense, G: Dense, equal: Any, delta: float) -> None:
        super().__init__(H, G, delta)
        self.equal, self.rest = np.flatnonzero(equal), np.flatnonzero(~equal)
        self.C, self.A = G[self.equal], G[self.rest]

    def _factor(self) -> bool:
        self.by = 1.0 / (self.theta[self.rest] + self.delta)
        rows = self.A * np.sqrt(self.by)[:, None]
        M: Any = np.array(self.H).T
        if rows.size:
            M = blas.dsyrk(1.0, rows.T, 1.0, M, lower=1, overwrite_c=1)
        M.T.flat[:: self.n + 1] += self.w + self.delta
        self.L, info = lapack.dpotrf(M, lower=1, clean=0, overwrite_a=1)
        if info != 0:
            return False
        if self.equal.size:
            self.half = blas.dtrsm(1.0, self.L, self.C.T, lower=1)
            S: Any = blas.dsyrk(1.0, self.half, trans=1, lower=1)
            S.T.flat[:: self.equal.size + 1] += self.delta
            self.S, info = lapack.dpotrf(S, lower=1, overwrite_a=1)
        return info == 0

    def apply(self, a: Vector, b: Vector) -> tuple[Vector, Vector]:
        right = a + self.A.T @ (self.by * b[self.rest]) if self.rest.size else a
        v = np.empty(b.size)
        if self.equal.size:
            y = blas.dtrsv(self.L, right, lower=1)
            v[self.equal] = lapack.dpotrs(self.S, self.half.T @ y - b[self.equal], lower=1)[0]
            x = blas.dtrsv(self.L, y - self.half @ v[self.equal], lower=1, trans=1)
        else:
            x = lapack.dpotrs(self.L, right, lower=1)[0]
        v[self.rest] = self.by * (self.A @ x - b[self.rest])
        return x, v


class SparseKKT(KKT):
    """LDLᵀ of the whole, in an order that leaves it sparse; the dense rest by LAPACK."""

    def __init__(self, H: Matrix, G: Matrix, delta: float) -> None:
        super().__init__(sp.csr_array(H), sp.csr_array(G), delta)
        self._kernel = load("cpbench.solvers.kernels.qp_ldl")
        r = self.G.shape[0]
        whole = sp.block_array([[self.H + sp.eye_array(self.n), self.Gt], [self.G, -sp.eye_array(r)]])
        upper = sp.coo_array(sp.triu(sp.block_array([[self.H, self.Gt], [None, sp.csr_array((r, r))]])))
        count = self._take(upper, csgraph.reverse_cuthill_mckee(sp.csr_array(whole), symmetric_mode=True))
        if float(count @ count) > CHEAP:
            count = self._take(upper, _minimum_degree(sp.csc_array(whole)))
        N = count.size
        dense = np.flatnonzero(count >= DENSE_SHARE * np.arange(N - 1, -1, -1))
        self._tail = int(dense[0]) if dense.size and N - dense[0] >= LEAST_TAIL else N
        count = count[: self._tail]
        self._starts = np.concatenate([[0], np.cumsum(count)])
        self._rows = np.empty(self._starts[-1], dtype=np.uint32)
        self._L, self._D = np.empty(self._starts[-1]), np.empty(self._tail)
        self._S = np.empty((N - self._tail, N - self._tail))

    def _take(self, upper: Any, order: Any) -> Any:
        """Bring the matrix into an order of elimination; entries below the diagonal of each column of its factor."""
        N = order.size
        place = np.empty(N, dtype=np.int64)
        place[order] = np.arange(N)
        i, j = (place[part] for part in upper.coords)
        i, j = np.concatenate([np.minimum(i, j), np.arange(N)]), np.concatenate([np.maximum(i, j), np.arange(N)])
        matrix = sp.csc_array((np.concatenate([upper.data, np.zeros(N)]), (i, j)), shape=(N, N))
        matrix.sum_duplicates()
        self._indptr, self._indices = matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)
        self._base, self._diagonal, self._order = matrix.data, self._indptr[1:] - 1, order
        self._parent, count = np.empty((2, N), dtype=np.int64)
        self._kernel.tree(self._indptr, self._indices, self._parent, count)
        return count

    def _factor(self) -> bool:
        data = self._base.copy()
        data[self._diagonal] += np.concatenate([self.w + self.delta, -self.theta - self.delta])[self._order]
        if not self._kernel.factor(
            self._indptr,
            self._indices,
            data,
            self._parent,
            self._starts,
            self._rows,
            self._L,
            self._D,
            self._S,
            self._tail,
        ):
            return False
        if not self._S.size:
            return True
        self._lu, self._pivots, info = lapack.dgetrf(self._S.T)
        return info == 0

    def apply(self, a: Vector, b: Vector) -> tuple[Vector, Vector]:
        x = np.concatenate([a, b])[self._order]
        self._kernel.forward(self._starts, self._rows, self._L, x, self._tail)
        if self._S.size:
            x[self._tail :] = lapack.dgetrs(self._lu, self._pivots, x[self._tail :])[0]
        self._kernel.backward(self._starts, self._rows, self._L, self._D, x, self._tail)
        found = np.empty_like(x)
        found[self._order] = x
        return found[: self.n], found[self.n :]


def _minimum_degree(K: Any) -> Any:
    """Return SuperLU's order of the columns of K, from an incomplete factorization that keeps next to nothing."""
    how: Any = {"drop_tol": 0.99, "fill_factor": 1, "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    return np.argsort(spla.spilu(K, permc_spec="MMD_AT_PLUS_A", **how).perm_c)
