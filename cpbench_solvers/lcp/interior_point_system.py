"""K + diag(0, θ) of an interior point method: factored anew for each θ, solved with refinement."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.linalg import lapack

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector, factor_on_diagonal, max_abs, memory_errors

REGULARISATION = 1e-11
"""Shift of the diagonal of the free unknowns where matrices are sparse or singular; refinement takes it out again."""
REFINEMENTS = 3
SOLVED = 1e-6
"""Of the right-hand side, what may be left."""


class ShiftedSystem:
    """K + diag(0, θ), factored anew for each θ: Cholesky where K is symmetric and dense, else LU."""

    def __init__(self, K: Matrix, free: int) -> None:
        self._K, self._free = K, free
        self._symmetric = not matrices.is_sparse(K) and matrices.is_symmetric(K)
        if matrices.is_sparse(K):
            every, N = sp.coo_array(K), K.shape[0]
            diagonal = np.arange(N)  # every entry of it has its place, zeros too
            rows, columns = (np.concatenate([part, diagonal]) for part in every.coords)
            both = np.concatenate([every.data, np.zeros(N)])
            self._sum: Any = sp.csc_array((both, (rows, columns)), shape=K.shape)
            self._sum.sum_duplicates()
            column = np.repeat(diagonal, np.diff(self._sum.indptr))
            self._diagonal = np.flatnonzero(self._sum.indices == column)
            self._base = self._sum.data.copy()

    def factor(self, theta: Vector) -> bool:
        """Factor the matrix; return False where it is singular or not finite."""
        self._theta = np.concatenate([np.zeros(self._free), theta])
        if not np.isfinite(theta).all():
            return False
        if matrices.is_sparse(self._K):
            return self._sparse()
        return self._dense(0.0) or self._dense(REGULARISATION)

    def _dense(self, shift: float) -> bool:
        self._shifted = shift > 0.0
        full = np.array(self._K, order="F")
        full[np.diag_indices_from(full)] += np.where(np.arange(full.shape[0]) < self._free, shift, self._theta)
        if self._symmetric:
            factor, info = lapack.dpotrf(full, lower=1)
            if info == 0:
                self._apply: Callable[[Vector], Vector] = lambda b: lapack.dpotrs(factor, b, lower=1)[0]
                return True
        lu, pivots, info = lapack.dgetrf(full, overwrite_a=True)
        self._apply = lambda b: lapack.dgetrs(lu, pivots, b)[0]
        return info == 0

    def _sparse(self) -> bool:
        shift = np.where(np.arange(self._theta.size) < self._free, REGULARISATION, self._theta)
        np.copyto(self._sum.data, self._base)
        self._sum.data[self._diagonal] += shift
        if self._free:
            try:
                with memory_errors():
                    lu: Any = spla.splu(self._sum)
            except RuntimeError:
                return False
        else:  # the symmetric part is positive definite
            lu = factor_on_diagonal(self._sum)
        if lu is None:
            return False
        self._apply, self._shifted = lu.solve, True
        return True

    def solve(self, b: Vector) -> Vector:
        """Solve, with refinement while it helps; a matrix that turns out to be singular is regularised."""
        x, left = self._refined(b)
        if not left <= SOLVED * max_abs(b) and not self._shifted and self._free and self._dense(REGULARISATION):
            x, left = self._refined(b)
        return x

    def _refined(self, b: Vector) -> tuple[Vector, float]:
        """Return x and what is left of b."""
        x = self._apply(b)
        left = b - self._K @ x - self._theta * x
        size = max_abs(left)
        for _ in range(REFINEMENTS):
            if not size > 1e-15 * max_abs(b):
                break
            better = x + self._apply(left)
            left = b - self._K @ better - self._theta * better
            if not max_abs(left) < 0.5 * size:
                break
            x, size = better, max_abs(left)
        return x, size
