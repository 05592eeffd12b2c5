"""EᵀWF + K over contacts, where E and F have the same block at every contact: what facets make of a Delassus operator.

W has d rows and columns a contact, E is blockdiag(left), F blockdiag(right), and K block diagonal with the block
Σ_s coefficients[c, s] · blocks[s] at contact c. A dense W gives a dense result, a sparse one canonical CSR without
explicit zeros: by SciPy's products where W is small, else by a compiled loop that writes the result once, about as
fast as the memory takes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.conversions.base import Size
from cpbench.conversions.kernels import congruence as kernel
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Matrix, Sparse, Vector, index_dtype

COMPILED_ABOVE = 500_000
"""Entries of W above which the compiled loop is used: SciPy's products are as fast below."""


@dataclass(frozen=True, eq=False)
class Congruence:
    """EᵀWF + K.

    Attributes
    ----------
    left, right : (d, k) and (d, l). blocks : (s, k, l); without any, K = 0.
    """

    left: Dense
    right: Dense
    blocks: Dense

    @property
    def d(self) -> int:
        return self.left.shape[0]

    def assemble(self, W: Matrix, coefficients: Dense) -> Matrix:
        """Assemble the matrix, (nc k, nc l), for coefficients of shape (nc, s)."""
        if not matrices.is_sparse(W):
            return self._dense(matrices.dense(W), coefficients)
        csr = matrices.sparse(W)
        if csr.nnz <= COMPILED_ABOVE:
            return self._products(csr, coefficients)
        return self._compiled(csr, coefficients)

    def size(self, W: Matrix) -> Size:
        """Bound the size of the result, reached when W has no zeros in its blocks."""
        nc = W.shape[0] // self.d
        rows, columns = nc * self.left.shape[1], nc * self.right.shape[1]
        if not matrices.is_sparse(W):
            return Size.dense(rows, columns)
        count = int(count_blocks(matrices.sparse(W), self.d).sum())
        return Size.sparse(rows, columns, self._room(count, nc))

    def _room(self, count: int, nc: int) -> int:
        """Return how many entries `count` blocks of W may make."""
        full = int(self.left.any(axis=0).sum()) * int(self.right.any(axis=0).sum())
        return count * full + nc * int(self.blocks.any(axis=0).sum())

    def _dense(self, W: Dense, coefficients: Dense) -> Dense:
        nc, d = coefficients.shape[0], self.d
        height, width = self.left.shape[1], self.right.shape[1]
        rows = np.matmul(self.left.T, W.reshape(nc, d, nc * d)).reshape(nc * height * nc, d)
        M = (rows @ self.right).reshape(nc, height, nc, width)
        diagonal = np.arange(nc)
        M[diagonal, :, diagonal, :] += np.einsum("cs,skl->ckl", coefficients, self.blocks)
        return M.reshape(nc * height, nc * width)

    def _products(self, W: Sparse, coefficients: Dense) -> Sparse:
        nc = coefficients.shape[0]
        E, F = repeat(self.left, np.ones(nc)), repeat(self.right, np.ones(nc))
        M = sp.csr_array(E.T @ W @ F)
        for block, weights in zip(self.blocks, coefficients.T, strict=True):
            M = sp.csr_array(M + repeat(block, weights))
        M.eliminate_zeros()
        index = index_dtype(M.nnz, *M.shape)
        M.indices, M.indptr = M.indices.astype(index, copy=False), M.indptr.astype(index, copy=False)
        return M

    def _compiled(self, W: Sparse, coefficients: Dense) -> Sparse:
        nc, d = coefficients.shape[0], self.d
        height, width = self.left.shape[1], self.right.shape[1]
        # a W of full blocks needs no counting, and the kernel sees at once whether it is one
        by_contact = np.diff(W.indptr[::d])
        most, count, full = int(by_contact.max(initial=0)) // d**2, W.nnz // d**2, True
        while True:
            room = self._room(count, nc) + 2 * width  # a row is written with its zeros, which are then taken out
            index = index_dtype(room, nc * height, nc * width, W.nnz, *W.shape)
            indptr, indices = W.indptr.astype(index, copy=False), W.indices.astype(index, copy=False)
            most += 1  # the diagonal block may be missing in W
            ptr, ix, x = np.empty(nc * height + 1, index), np.empty(room, index), np.empty(room)
            longest = int(self.right.any(axis=0).sum()) * most + width
            work = np.empty(d, np.int64), np.empty(most, np.int64), np.empty((d, d * most)), np.empty((d, longest))
            tables = self._tables(), coefficients, *work, np.empty(longest, index)
            entries = kernel.write(indptr, indices, W.data, full, *tables[0], *tables[1:], ptr, ix, x)
            if entries != kernel.NOT_FULL:
                break
            blocks = count_blocks(W, d)
            most, count, full = int(blocks.max(initial=0)), int(blocks.sum()), False
        x.resize(entries, refcheck=False)  # gives back what zeros did not take, in place
        ix.resize(entries, refcheck=False)
        M = sp.csr_array((x, ix, ptr), shape=(nc * height, nc * width))
        # the 2-norm bounds the largest entry and, unlike that, costs one pass
        largest = (
            float(np.linalg.norm(W.data)) * np.abs(self.left).sum(axis=0).max() * np.abs(self.right).sum(axis=0).max()
        )
        added = np.abs(coefficients).max(initial=0.0) * np.abs(self.blocks).sum(axis=0).max(initial=0.0)
        if np.isfinite(largest + added):  # then no entry can be infinite, and none need be looked at
            return matrices.adopt(M)
        return M

    def _tables(self) -> tuple[Any, ...]:
        """Return the tables of left, right and blocks that the kernel needs."""
        some: NDArray[np.bool_] = np.any(self.blocks, axis=0)
        active = np.flatnonzero(self.right.any(axis=0))
        wide = np.flatnonzero(self.right.any(axis=0) | some.any(axis=0))
        chosen = np.concatenate([active, wide])
        e_count, e_place = _nonzeros(self.left.T)
        k_count, k_place = _nonzeros(some[:, wide])
        e_value = np.take_along_axis(self.left.T, e_place, axis=1)
        e_value = np.where(np.arange(self.d) < e_count[:, None], e_value, 0.0)
        F, K = np.ascontiguousarray(self.right[:, chosen]), np.ascontiguousarray(self.blocks[:, :, wide])
        return e_count, e_place, e_value, F, chosen, active.size, self.right.shape[1], k_count, k_place, K


def count_blocks(W: Sparse, d: int) -> NDArray[np.int64]:
    """Count the d x d blocks with an entry that the rows of every contact have, shape (nc,)."""
    nc = W.shape[0] // d
    if W.nnz > COMPILED_ABOVE:
        blocks, index = np.empty(nc, np.int64), index_dtype(W.nnz, *W.shape)
        at = np.empty(d, np.int64)
        kernel.count_blocks(W.indptr.astype(index, copy=False), W.indices.astype(index, copy=False), at, blocks)
        return blocks
    contact = np.repeat(np.arange(W.shape[0]) // d, np.diff(W.indptr))
    seen = np.unique(contact * max(nc, 1) + W.indices // d)
    return np.bincount(seen // max(nc, 1), minlength=nc).astype(np.int64)


def _nonzeros(A: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Count the nonzeros of the rows, and return their columns, padded with 0 to the width of A."""
    present = A.astype(bool)
    order = np.argsort(~present, axis=1, kind="stable")
    count = present.sum(axis=1, dtype=np.int64)
    return count, np.where(np.arange(A.shape[1]) < count[:, None], order, 0)


def repeat(block: Dense, weights: Vector) -> Sparse:
    """Return blockdiag(weights_c · block) over the contacts c, CSR; `block` (h, w), result (nc·h, nc·w)."""
    row, col = np.nonzero(block)
    height, width = block.shape
    contact = np.arange(weights.size)[:, None]
    indices = ((contact * height + row).ravel(), (contact * width + col).ravel())
    shape = (weights.size * height, weights.size * width)
    return sp.csr_array((np.outer(weights, block[row, col]).ravel(), indices), shape=shape)
