"""D A⁻¹C for large sparse A and columns of C and rows of D with few entries, without ever forming A⁻¹C.

With PAQ = LU, D A⁻¹C = YᵀX for X = L⁻¹PC and Y = U⁻ᵀQᵀDᵀ. Each column of X and Y is solved for as a sparse vector,
whose entries lie on paths to the root of the elimination tree; nested dissection makes these short. Most columns meet
near the root: those rows of X and Y are multiplied as dense matrices, the others as sparse ones.

Whether that beats right-hand sides in dense bundles, or LAPACK on a dense A, is told in advance by the elimination tree
of A + Aᵀ: exactly, but for pivots off the diagonal.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.csgraph as csgraph
from numpy.typing import NDArray

from cpbench.foundation import matrices
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.kernel_cache import load
from cpbench.foundation.matrices import Dense, Matrix, Sparse

KERNELS = "cpbench.conversions.kernels.triangular"
PIVOT = 0.1
"""A diagonal entry stays the pivot when it is at least this share of the greatest in its column."""
GROWTH = 1e3
"""Greatest entry of U over that of A above which threshold pivoting is given up for partial pivoting, in bundles: the
backward error of a solve is about that times 1e-16."""
CROWDED = 0.2
"""Share of the columns from which on a row of X counts as dense."""
SECONDS = {"dense": 2.5e-11, "bundle": 3.5e-10, "unknown": 1.8e-8, "sparse": 2e-9, "order": 1e-6, "start": 0.02}
"""Measured: a flop of LAPACK; an entry of L and U, and an unknown, a right-hand side of SuperLU; a sparse
multiplication; dissecting, an unknown; and what small problems had better not begin."""
FULL = 0.5
"""Share of nonzero entries above which a product is kept dense: CSR would then need as much memory."""
DENSE_BYTES = 2**30
"""Most memory of an A made dense."""


def product(left: Sparse, factor: Factorization, right: Sparse) -> Matrix | None:
    """Compute left A⁻¹ right, None where bundles of dense right-hand sides cost less."""
    n, columns = factor.n, min(left.shape[0], right.shape[1])
    bundles = columns * (SECONDS["bundle"] * factor.entries + SECONDS["unknown"] * n)
    dense = np.inf
    if 8 * n * n <= DENSE_BYTES:
        flops = 2 / 3 * n**3 + 2.0 * n * n * columns + 2.0 * n * left.shape[0] * right.shape[1]
        dense = SECONDS["dense"] * flops
    sparse = SECONDS["start"] + SECONDS["order"] * n
    if sparse < min(bundles, dense):
        plan = _Plan.of(factor, left, right, limit=4 * factor.entries)
        if plan is not None and sparse + plan.seconds < min(bundles, dense):
            result = _by_reach(left, factor, right, plan)
            if result is not None:
                return result
    if dense < bundles:
        return matrices.dense(left @ Factorization(matrices.dense(factor.A)).solve(right))
    return None


@dataclass(frozen=True)
class _Plan:
    """An order of the unknowns, the columns that stand on the diagonal then, and what the product costs by them."""

    order: NDArray[np.int32]
    matching: NDArray[np.int32]
    entries: int
    seconds: float

    @staticmethod
    def of(factor: Factorization, left: Sparse, right: Sparse, limit: int) -> _Plan | None:
        """Plan the elimination; None where L would have more than `limit` entries, or A is structurally singular."""
        kernel, A, n = load(KERNELS), matrices.sparse(factor.A), factor.n
        matching = np.arange(n, dtype=np.int32)
        if not A.diagonal().all():
            matching = csgraph.maximum_bipartite_matching(A, perm_type="column")
            if (matching < 0).any():
                return None
            A = matrices.sparse(A[:, matching])
        ones = sp.csr_array(A, copy=True)
        ones.data[:] = 1.0  # nothing cancels
        graph = sp.csr_array(ones + ones.T)
        pattern = graph.indptr.astype(np.int32), graph.indices.astype(np.int32)
        order, parent, count = np.empty(n, np.int32), np.empty(n, np.int32), np.empty(n, np.int64)
        kernel.dissect(*pattern, order)
        entries = kernel.eliminate(*pattern, order, limit, parent, count)
        if entries < 0:
            return None
        # entries of C below a node, of D likewise: at most that many columns of X and Y reach it
        into = np.diff(right.indptr)[order].astype(np.int64)
        back = np.bincount(left.indices, minlength=n)[matching][order]
        visits = kernel.gather_up(parent, into, right.shape[1]), kernel.gather_up(parent, back, left.shape[0])
        crowded = (visits[0] >= CROWDED * right.shape[1]) & (visits[1] >= CROWDED * left.shape[0])
        both = visits[0].astype(float) * visits[1]
        multiplied = float((visits[0] + visits[1]) @ count) + float(both[~crowded].sum())
        multiplied += float((count * count).sum())  # to factor
        dense = 2.0 * crowded.sum() * left.shape[0] * right.shape[1]
        return _Plan(order, matching, entries, SECONDS["sparse"] * multiplied + SECONDS["dense"] * dense)


def _by_reach(left: Sparse, factor: Factorization, right: Sparse, plan: _Plan) -> Matrix | None:
    """Multiply by reach; None where pivots near the diagonal do not solve accurately."""
    A, order, columns = matrices.sparse(factor.A), plan.order, plan.matching[plan.order]
    if factor.scales is not None:
        rows_scale, columns_scale = factor.scales
        A, left, right = (
            matrices.sparse(part)
            for part in (
                sp.diags_array(rows_scale) @ A @ sp.diags_array(columns_scale),
                left @ sp.diags_array(columns_scale),
                sp.diags_array(rows_scale) @ right,
            )
        )
    A = sp.csc_array(A[order][:, columns])
    A.sort_indices()
    kernel = load(KERNELS)
    regular, row_of, L, U, pivots = kernel.factor(*_parts(A), PIVOT, plan.entries)
    greatest = max(matrices.max_abs(U[2]), matrices.max_abs(pivots))
    if not regular or greatest > GROWTH * matrices.max_abs(A.data):
        return None
    into = sp.csc_array(right[order[np.argsort(row_of)]])
    back = sp.csc_array(sp.csr_array(left.T)[columns])
    X = _by_rows(kernel.solve(*L, np.ones(factor.n), *_parts(into)), into.shape)
    by_rows = _by_rows(U, A.shape)  # the columns of the lower triangle Uᵀ
    Y = _by_rows(kernel.solve(by_rows.indptr.astype(np.int64), *_parts(by_rows)[1:], pivots, *_parts(back)), back.shape)
    return _multiply(kernel, Y, X)


def _by_rows(columns: tuple[NDArray[Any], NDArray[Any], NDArray[np.float64]], shape: tuple[int, int]) -> Sparse:
    pointers, index, values = columns
    return sp.csr_array(sp.csc_array((values, index, pointers), shape=shape))


def _multiply(kernel: Any, Y: Sparse, X: Sparse) -> Matrix:
    """Compute YᵀX: dense, in two parts, where it may fill up."""
    shape = (Y.shape[1], X.shape[1])
    in_x, in_y = np.diff(X.indptr), np.diff(Y.indptr)
    if float(in_x.astype(float) @ in_y) < 0.25 * shape[0] * shape[1]:
        return sp.csr_array(Y.T @ X)
    crowded = (in_x >= CROWDED * shape[1]) & (in_y >= CROWDED * shape[0])
    full: Dense = Y[crowded].toarray().T @ X[crowded].toarray()
    few = np.flatnonzero(~crowded)
    kernel.add_product(*_parts(sp.csr_array(Y[few].T)), *_parts(X[few]), full)
    nonzeros = np.count_nonzero(full, axis=1)
    if nonzeros.sum() > FULL * full.size:
        return full
    indptr = np.concatenate([[0], np.cumsum(nonzeros)])
    indices, data = np.empty(indptr[-1], dtype=np.int32), np.empty(indptr[-1])
    kernel.compress(full, indptr, indices, data)
    return sp.csr_array((data, indices, indptr), shape=shape)


def _parts(M: Any) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.float64]]:
    return M.indptr.astype(np.int32, copy=False), M.indices.astype(np.int32, copy=False), M.data
