"""Converted matrices that are never assembled, for solvers that only multiply."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse.linalg as spla

from cpbench.foundation.matrices import Dense, Matrix
from cpbench.foundation.matrices import sparse as csr_of


class ContactOperator(spla.LinearOperator):
    """EᵀWF + K with block-diagonal E, F and K, as in `cpbench.conversions.congruence`; keeps W itself.

    Parameters
    ----------
    W : (nc d, nc d). left, right : (d, k) and (d, l). blocks : (s, k, l). coefficients : (nc, s).
    """

    def __init__(self, W: Matrix, left: Dense, right: Dense, blocks: Dense, coefficients: Dense) -> None:
        nc = coefficients.shape[0]
        super().__init__(np.dtype(np.float64), (nc * left.shape[1], nc * right.shape[1]))
        self.W, self.left, self.right, self.blocks, self.coefficients = W, left, right, blocks, coefficients

    @property
    def nbytes(self) -> int:
        """Bytes of W and of the coefficients."""
        if isinstance(self.W, np.ndarray):
            return self.W.nbytes + self.coefficients.nbytes
        W = csr_of(self.W)
        return W.data.nbytes + W.indices.nbytes + W.indptr.nbytes + self.coefficients.nbytes

    def _matmat(self, X: Any) -> Any:
        return self._times(self.W, self.left, self.right, self.blocks, X)

    def _rmatmat(self, X: Any) -> Any:
        return self._times(self.W.T, self.right, self.left, self.blocks.transpose(0, 2, 1), X)

    def _matvec(self, x: Any) -> Any:
        return self._matmat(x.reshape(-1, 1))[:, 0]

    def _rmatvec(self, x: Any) -> Any:
        return self._rmatmat(x.reshape(-1, 1))[:, 0]

    def _times(self, W: Any, left: Dense, right: Dense, blocks: Dense, X: Any) -> Any:
        nc, width = self.coefficients.shape[0], X.shape[1]
        x = np.asarray(X, dtype=np.float64).reshape(nc, right.shape[1], width)
        inside = W @ np.matmul(right, x).reshape(nc * right.shape[0], width)
        result = np.matmul(left.T, inside.reshape(nc, left.shape[0], width))
        for block, weights in zip(blocks, self.coefficients.T, strict=True):
            result += weights[:, None, None] * np.matmul(block, x)
        return result.reshape(nc * left.shape[1], width)
