"""The linear systems of methods for QPs: [[H + diag(w), Gᵀ], [G, −diag(θ)]] with ever new w, θ ≥ 0.

Static regularization makes the matrix quasi-definite, so that every order of pivots is stable enough for refinement,
which takes it out again (Vanderbei 1995, SIAM J. Optim. 5:100). The pattern is analysed once: an order by minimum
degree, the factor's columns by the elimination tree.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector
from cpbench_solvers.kernels import minimum_degree, qp_ldl, qp_sparse, qp_system

Entries: TypeAlias = tuple[NDArray[np.int32], NDArray[np.int32], Vector]
"""Row pointers, columns and numbers of a sparse matrix."""
LEAST_TAIL, MOST_TAIL = 80, 6000
"""Rows that are worth a dense rest, and those that fit into memory."""
RATE = 2e9
"""Operations a second of large factorizations, whose time is known before they begin."""
BLAS = 8.0
"""So many operations of dense matrices take the time of one of a sparse factor."""
EVEN = 40.0
"""Operations for every entry up to which diagonal unknowns are eliminated first, and no order is sought: that takes the
time of more of them."""
FULL = 0.25
"""With this share of entries that are not 0 the system is dense without further thought."""


def entries(M: Matrix) -> Entries:
    """Return a matrix as the kernels take it, the columns of each row in order: they read full rows without them."""
    if matrices.is_sparse(M):
        S: Any = M
        S = S if S.has_sorted_indices else S.sorted_indices()
        indptr, indices = (np.ascontiguousarray(part, dtype=np.int32) for part in (S.indptr, S.indices))
        return indptr, indices, np.ascontiguousarray(S.data)
    return qp_sparse.rows_of(np.ascontiguousarray(M))


class KKT:
    """The system of H (n, n) and G (r, n) with the regularization `delta`.

    equal : rows that have θ = 0, or nearly so, in every system, none by default. Dense where that takes less time; full
    rows of H and G have all their zeros then.
    operations : of one factorization, counted as those of a sparse factor. seconds : that it takes, about.
    """

    def __init__(self, H: Entries, G: Entries, delta: float, equal: NDArray[np.bool_] | None = None) -> None:
        self.H, self.G, self._delta = H, G, delta
        self._kernel = qp_system
        n, r = H[0].size - 1, G[0].size - 1
        self.n, self._r = n, r
        zero = np.zeros(r, dtype=bool) if equal is None else equal
        self._rest, self._equal = np.flatnonzero(~zero), np.flatnonzero(zero)
        m, k = self._rest.size, self._equal.size
        last = np.empty(m), np.zeros(5 * (n + r))
        self.operations = (m * n * n + (n + k) ** 3 / 3.0) / BLAS
        if H[2].size + G[2].size < FULL * n * (n + r):
            count, pattern = self._analysed()
            # operations for every number of columns that are eliminated as sparse ones
            work = np.concatenate([[0.0], np.cumsum(count.astype(float) ** 2)])
            work += np.arange(n + r, -1, -1) ** 3.0 / (3.0 * BLAS)
            first = max(n + r - MOST_TAIL, 0)
            tail = first + int(np.argmin(work[first:]))
            tail = tail if n + r - tail >= LEAST_TAIL else n + r
            if work[tail] <= self.operations:
                self.operations = float(work[tail])
                self.system = (*self._sparse(count[:tail], pattern), *last)
                return
        self.H, self.G = self._kernel.filled(H, n), self._kernel.filled(G, n)
        self.system = (*self._dense(m, k), *last)

    @property
    def seconds(self) -> float:
        return self.operations / RATE

    def _dense(self, m: int, k: int) -> tuple[Any, ...]:
        none, index, nothing = np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int32), np.empty(0)
        A = np.zeros((self.n, m))
        self._kernel.columns_of(self.G, self._rest, A)
        pattern = none, index, index, nothing, nothing, none, none
        factor = np.empty(0, dtype=np.uint32), nothing, nothing, np.zeros((self.n + k, self.n + k))
        return np.array([-1]), *pattern, *factor, self._rest, self._equal, A

    def _analysed(self) -> tuple[Any, tuple[Any, ...]]:
        """Return entries below the diagonal of each column of the factor, and the matrix in the order of
        elimination."""
        ldl, H, G = qp_ldl, self.H, self.G
        N = self.n + self._r
        size = H[2].size + 2 * G[2].size
        work, indptr, indices = np.empty(N, dtype=np.int64), np.empty(N + 1, dtype=np.int32), np.empty(size, np.int32)
        ldl.adjacency(H, G, work, indptr, indices)
        order, position = np.empty((2, N), dtype=np.int64)
        rows, columns = np.repeat(np.arange(self.n), np.diff(H[0])), np.bincount(G[1], minlength=self.n)
        if (H[1] == rows).all() and columns @ columns + self._r**3 / (3.0 * BLAS) <= EVEN * size:
            order[:] = np.arange(N)
        else:
            minimum_degree.minimum_degree(indptr, indices[: indptr[-1]], order)
        position[order] = np.arange(N)
        indptr, indices = np.empty(N + 1, dtype=np.int32), np.empty(H[2].size + G[2].size, dtype=np.int32)
        data, diagonal = np.empty(indices.size), np.empty(N)
        ldl.permuted(H, G, position, work, np.empty(N, dtype=np.int64), indptr, indices, data, diagonal)
        parent, count = np.empty((2, N), dtype=np.int64)
        ldl.tree(indptr, indices, parent, count)
        return count, (order, indptr, indices, data, diagonal, parent)

    def _sparse(self, count: Any, pattern: tuple[Any, ...]) -> tuple[Any, ...]:
        tail, rest = count.size, self.n + self._r - count.size
        starts = np.concatenate([[0], np.cumsum(count)])
        factor = np.empty(starts[-1], dtype=np.uint32), np.empty(starts[-1]), np.empty(tail), np.zeros((rest, rest))
        none = np.empty(0, dtype=np.int64)
        return np.array([tail]), *pattern, starts, *factor, none, none, np.empty((self.n, 0))

    def factor(self, w: Vector, theta: Vector) -> bool:
        """Factor; return False where it breaks down."""
        self._w, self._theta = np.ascontiguousarray(w, dtype=float), np.ascontiguousarray(theta, dtype=float)
        finite = bool(np.isfinite(w).all() and np.isfinite(theta).all())
        return finite and self._kernel.factor_system(self.H, self.G, self.system, self._w, self._theta, self._delta)

    def solve(self, a: Vector, b: Vector) -> tuple[Vector, Vector]:
        """Return (dx, v), refined while that helps."""
        x, v = np.empty(self.n), np.empty(self._r)
        self._kernel.solve_system(self.H, self.G, self.system, self._w, self._theta, a, b, x, v)
        return x, v
