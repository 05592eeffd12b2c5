"""Products with an inverse, D A⁻¹ C, for the edges that eliminate unknowns (Schur complement, Delassus operator).

Sparse stays sparse. A matrix falls apart into the connected components of its graph (bodies of a mechanical
system, nodes of a circuit), and so does the product. Small components are inverted all at once, as dense blocks:
their inverse is as sparse as they are. A large one is factored, and the columns of C that touch it are solved
for in bundles, so that no more than a few hundred dense columns exist at a time.
"""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from cpbench import matrices
from cpbench.matrices import Dense, Factorization, Matrix, Sparse

SMALL_COMPONENT = 32
"""Components up to this size are inverted; a body has 3 or 6 unknowns."""
BUNDLE = 256
"""Right-hand sides of one sparse solve."""
FULL = 0.5
"""Share of nonzero entries above which an eliminated matrix is kept dense: CSR would then need as much memory."""
RANK_LIMIT = 500
"""Largest matrix whose rank is told in a refusal (it takes a singular value decomposition)."""


def product(left: Matrix, factor: Factorization, right: Matrix) -> Matrix:
    """left · A⁻¹ · right for a nonsingular A; shapes (m, n), (n, n), (n, k).

    Dense when one of the three is (A⁻¹ is never formed); otherwise CSR, or dense when it fills up.
    """
    if not all(matrices.is_sparse(part) for part in (left, factor.A, right)):
        return matrices.dense(left @ factor.solve(right))
    rows, cols = left.shape[0], right.shape[1]
    result = sp.csr_array((rows, cols), dtype=np.float64)
    if factor.n and rows and cols:
        A = sp.csr_array(factor.A, copy=True)
        A.eliminate_zeros()
        for unknowns in _large(A):
            result = result + _by_factor(matrices.sparse(left), A, factor, matrices.sparse(right), unknowns)
        inverse = _small_inverse(A)
        if inverse.nnz:
            result = result + left @ (inverse @ right)
    return compact(result)


def compact(M: Matrix) -> Matrix:
    """CSR, or the dense array when more than the share FULL of the entries is nonzero."""
    if not matrices.is_sparse(M):
        return M
    return matrices.dense(M) if matrices.nnz(M) > FULL * M.shape[0] * M.shape[1] else matrices.sparse(M)


def singularity(factor: Factorization, what: str, instead: str) -> str | None:
    """The obstacle of an edge that needs `factor`'s matrix, called `what`, to be nonsingular; None when it is."""
    if not factor.singular:
        return None
    n = factor.n
    rank = f", rank {matrices.rank(factor.A)}" if n <= RANK_LIMIT else ""
    condition = f"{1 / factor.rcond:.1e}" if factor.rcond > 0 else "infinite"
    return f"{what} ({n}x{n}{rank}) is numerically singular, condition number {condition}; {instead}"


def _components(A: Sparse) -> tuple[NDArray[Any], NDArray[Any]]:
    """Label of every unknown and size of every component."""
    _, labels = cast("tuple[int, NDArray[Any]]", connected_components(A, directed=False))
    return labels, np.bincount(labels)


def _large(A: Sparse) -> list[NDArray[Any]]:
    labels, sizes = _components(A)
    return [np.flatnonzero(labels == k) for k in np.flatnonzero(sizes > SMALL_COMPONENT)]


def _by_factor(left: Sparse, A: Sparse, factor: Factorization, right: Sparse, unknowns: NDArray[Any]) -> Sparse:
    """The part of left A⁻¹ right that goes through one large component."""
    whole = unknowns.size == factor.n
    part = factor if whole else Factorization(sp.csr_array(A[unknowns][:, unknowns]))
    into = (right if whole else right[unknowns]).tocsc()
    out = left if whole else left[:, unknowns]
    columns = np.flatnonzero(np.diff(into.indptr))
    touched = np.flatnonzero(np.diff(out.indptr))
    out = out[touched]
    pieces: list[Dense] = []
    for start in range(0, columns.size, BUNDLE):
        bundle = into[:, columns[start : start + BUNDLE]].toarray()
        pieces.append(out @ part.solve(bundle))
    if not pieces or not touched.size:
        return sp.csr_array((left.shape[0], right.shape[1]), dtype=np.float64)
    values = sp.coo_array(np.hstack(pieces))
    place = (touched[values.row], columns[values.col])
    return sp.csr_array((values.data, place), shape=(left.shape[0], right.shape[1]))


def _small_inverse(A: Sparse) -> Sparse:
    """A⁻¹ on the unknowns of the small components, zero elsewhere."""
    labels, sizes = _components(A)
    order = np.argsort(labels, kind="stable")
    first = np.concatenate([[0], np.cumsum(sizes)])
    position = np.empty(labels.size, dtype=np.int64)  # of an unknown within its component
    position[order] = np.arange(labels.size) - first[labels[order]]
    coo = A.tocoo()
    size_of_entry = sizes[labels[coo.row]]
    triplets: list[tuple[NDArray[Any], NDArray[Any], NDArray[Any]]] = []
    for size in np.unique(sizes[sizes <= SMALL_COMPONENT]):
        members = np.flatnonzero(sizes == size)
        number = np.full(sizes.size, -1)
        number[members] = np.arange(members.size)
        here = size_of_entry == size
        row, col = coo.row[here], coo.col[here]
        blocks = np.zeros((members.size, size, size))
        blocks[number[labels[row]], position[row], position[col]] = coo.data[here]
        unknowns = order[first[members][:, None] + np.arange(size)]
        inverse = np.linalg.inv(blocks)
        shape = inverse.shape
        triplets.append(
            (
                inverse.ravel(),
                np.broadcast_to(unknowns[:, :, None], shape).ravel(),
                np.broadcast_to(unknowns[:, None, :], shape).ravel(),
            )
        )
    if not triplets:
        return sp.csr_array(A.shape, dtype=np.float64)
    data, row, col = (np.concatenate(part) for part in zip(*triplets, strict=True))
    result = sp.csr_array((data, (row, col)), shape=A.shape)
    result.eliminate_zeros()
    return result
