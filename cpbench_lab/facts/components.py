"""Eigenvalues and singular values of a matrix, one connected component of its graph at a time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, cast

import numpy as np
import scipy.sparse as sp
import scipy.sparse.csgraph as csgraph
from numpy.typing import NDArray

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Matrix, Vector

EIGEN_LIMIT = 1000
"""Largest component whose eigenvalues or singular values are computed (under a second)."""
EIGEN_WORK = 4e9
"""Bound on the sum of size³ over the components."""


class Components:
    """The connected components of a sparse matrix: blocks that no entry joins, each of certain rows and columns."""

    def __init__(self, M: Matrix, *, symmetric: bool) -> None:
        csr = sp.csr_array(M, copy=True)
        csr.eliminate_zeros()
        rows = csr.shape[0]
        if symmetric:  # the same label for row i and column i
            self.count, labels = csgraph.connected_components(csr, directed=False)
            self.row_label = self.col_label = labels
        else:
            graph = sp.block_array([[None, csr], [csr.T, None]], format="csr")
            self.count, labels = csgraph.connected_components(graph, directed=False)
            self.row_label, self.col_label = labels[:rows], labels[rows:]
        self.entries = csr.tocoo()
        self.height = np.bincount(self.row_label, minlength=self.count)
        self.width = np.bincount(self.col_label, minlength=self.count)

    @property
    def side(self) -> int:
        return int(max(self.height.max(), self.width.max()))

    @property
    def work(self) -> float:
        """Sum of rows·cols·min(rows, cols)."""
        height, width = self.height.astype(float), self.width.astype(float)
        return float((height * width * np.minimum(height, width)).sum())

    def blocks(self) -> Iterator[Dense]:
        """Yield stacks (k, rows, cols) of the components of one shape; those without a row or a column are left out."""
        row, col = self.entries.row, self.entries.col
        component = self.row_label[row]
        row, col = _place(self.row_label, self.height)[row], _place(self.col_label, self.width)[col]
        shapes = np.stack([self.height, self.width], axis=1)
        for shape in np.unique(shapes[(shapes > 0).all(axis=1)], axis=0):
            members = np.flatnonzero((shapes == shape).all(axis=1))
            number = np.full(self.count, -1)
            number[members] = np.arange(members.size)
            here = number[component] >= 0
            stack = np.zeros((members.size, *shape))
            stack[number[component[here]], row[here], col[here]] = self.entries.data[here]
            yield stack


def _place(labels: NDArray[Any], sizes: NDArray[Any]) -> NDArray[np.int64]:
    """Return the position of every index among those of its label."""
    order = np.argsort(labels, kind="stable")
    start = np.concatenate([[0], np.cumsum(sizes)])[:-1]
    place = np.empty(labels.size, dtype=np.int64)
    place[order] = np.arange(labels.size) - start[labels[order]]
    return place


def eigenvalues(S: Matrix) -> Vector | None:
    """Return all eigenvalues of a symmetric matrix, component by component; None where that costs too much."""
    if not matrices.is_sparse(S):
        return cast(Vector, np.linalg.eigvalsh(S)) if S.shape[0] <= EIGEN_LIMIT else None
    parts = Components(S, symmetric=True)
    if parts.side > EIGEN_LIMIT or parts.work > EIGEN_WORK:
        return None
    return cast(Vector, np.concatenate([np.linalg.eigvalsh(stack).ravel() for stack in parts.blocks()]))


def singular_values(M: Matrix) -> Vector | None:
    """Return the singular values of the components of M; None where that costs too much."""
    rows, cols = M.shape
    if not matrices.is_sparse(M):
        small = float(rows) * cols * min(rows, cols) <= EIGEN_LIMIT**3
        return cast(Vector, np.linalg.svd(matrices.dense(M), compute_uv=False)) if small else None
    parts = Components(M, symmetric=False)
    if parts.side > 4 * EIGEN_LIMIT or parts.work > EIGEN_WORK / 4:
        return None
    singular = [np.linalg.svd(stack, compute_uv=False).ravel() for stack in parts.blocks()]
    return cast(Vector, np.concatenate(singular))
