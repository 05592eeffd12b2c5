"""D A⁻¹C over the small components of A: the Delassus operator HᵀM⁻¹H of bodies that touch at contacts.

Every body has its own dense block M_b, and a contact touches one or two of them, so that HᵀM⁻¹H consists of small
dense blocks Σ_b H_biᵀM_b⁻¹H_bj, one for each pair of contacts that share a body. With the unknowns of each body beside
each other these are products of SciPy's block matrices (BSR).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.foundation.factorization import Blocks, Factorization
from cpbench.foundation.matrices import Sparse

FEW = 15_000
"""Entries of D and C up to which blocks do not pay."""
PADDING = 1.25
"""Zeros that blocks may add, as a factor of the entries."""
GROUPS = (3, 2, 5, 1)
"""Columns of a contact: friction in space, in the plane, rolling friction; or no such groups."""


def product(left: Sparse, factor: Factorization, right: Sparse) -> Sparse:
    """Return left A⁻¹ right over the components in `factor.blocks`."""
    if left.nnz + right.nnz <= FEW:
        return sp.csr_array(left @ (factor.sparse_inverse @ right))
    size = _common_size(factor.blocks)
    columns = _by_bodies(right, factor.blocks, size)
    rows = _by_bodies(sp.csr_array(left.T), factor.blocks, size)
    return _canonical(rows.T @ (_block_diagonal(factor.block_inverses, size) @ columns))


def congruence(H: Sparse, factor: Factorization) -> Sparse | None:
    """Return HᵀA⁻¹H over the components in `factor.blocks`, symmetric to the last bit; A is symmetric.

    None where one is not positive definite, and where H is so small that blocks do not pay. With A_b = L Lᵀ both sides
    are L⁻¹H, so that entry ij is the same sum of the same products in the same order as entry ji.
    """
    if H.nnz <= FEW:
        return None
    try:
        inverses = [Blocks(b.unknowns, np.linalg.inv(np.linalg.cholesky(b.values))) for b in factor.blocks]
    except np.linalg.LinAlgError:
        return None
    size = _common_size(factor.blocks)
    columns = _block_diagonal(inverses, size) @ _by_bodies(H, factor.blocks, size)
    return _canonical(columns.T @ columns)


def _common_size(blocks: list[Blocks]) -> int:
    """Return the size of block that all bodies consist of."""
    return math.gcd(*(b.unknowns.shape[1] for b in blocks))


def _by_bodies(C: Sparse, blocks: list[Blocks], size: int) -> Any:
    """Return the rows of C, those of each body beside each other, in blocks of `size` rows and the columns of a
    contact."""
    ordered = sp.csr_array(C[np.concatenate([b.unknowns.ravel() for b in blocks])])
    for d in GROUPS:
        if C.shape[1] % d == 0:
            grouped = ordered.tobsr((size, d))
            if grouped.data.size <= PADDING * C.nnz:
                return grouped
    return ordered.tobsr((size, 1))


def _block_diagonal(blocks: list[Blocks], size: int) -> Any:
    """Return the block-diagonal matrix of these blocks, one after the other, in blocks of `size`."""
    data: list[NDArray[np.float64]] = []
    columns: list[NDArray[np.int64]] = []
    counts: list[NDArray[np.int64]] = []
    first = 0
    for block in blocks:
        number, parts = len(block.values), block.values.shape[1] // size
        split = block.values.reshape(number, parts, size, parts, size).transpose(0, 1, 3, 2, 4)
        data.append(split.reshape(-1, size, size))
        begin = first + parts * np.arange(number)
        columns.append((begin[:, None, None] + np.arange(parts)).repeat(parts, axis=1).ravel())
        counts.append(np.full(number * parts, parts))
        first += number * parts
    indptr = np.concatenate([[0], np.cumsum(np.concatenate(counts))])
    return sp.bsr_array((np.concatenate(data), np.concatenate(columns), indptr), shape=(first * size, first * size))


def _canonical(W: Any) -> Sparse:
    """Return CSR, sorted and without the zeros of blocks that are not full."""
    W.sort_indices()
    result = sp.csr_array(W.tocsr())
    result.has_canonical_format = True
    if not result.data.all():
        result.eliminate_zeros()
    return result
