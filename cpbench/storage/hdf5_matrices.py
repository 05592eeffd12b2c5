"""Matrices in HDF5: FCLIB's group (nzmax, m, n, nz, p, i, x) for sparse ones, a 2-D data set for dense ones.

    nz >= 0   triplet, nz entries: i = row, p = column (CSparse order; fclib.h says the opposite, every file says this)
    nz = -1   compressed columns: p column pointers (n + 1), i rows
    nz = -2   compressed rows: p row pointers (m + 1), i columns

`nzmax` may exceed the entries that are there, duplicates add up, and the attribute ``symmetric_packed = 1`` says
that only the lower triangle is stored.
"""

from __future__ import annotations

import logging
from typing import Any

import h5py
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Sparse
from cpbench.storage.hdf5_tree import Tree, put_array, put_integer

logger = logging.getLogger("cpbench.storage")
CSC, CSR = -1, -2
_INT32 = 2**31 - 1


def read_matrix(tree: Tree, name: str, shape: tuple[int | None, int | None], *, packed: bool = False) -> Matrix:
    """Read the matrix `name`; `shape` is what the rest of the file says it must be (None: free, then it must be dense
    or stored by rows), `packed` that only its lower triangle is there.

    Raises FormatError before allocating anything that the file does not hold.
    """
    if not tree.is_group(name):
        M = tree.array(name, ndim=2)
        _require_shape(tree, name, M.shape, shape)
        return M
    group = tree.child(name)
    m, n, nz = group.integer("m"), group.integer("n"), group.integer("nz")
    _require_shape(tree, name, (m, n), shape)
    if None in shape and nz != CSR:
        raise group.error("nz", f"is {nz}, expected -2: nothing else in the file tells the size of this matrix")
    p, i = group.array("p", np.integer), group.array("i", np.integer)
    x = group.array("x")
    if nz in (CSC, CSR):
        csr = _compressed(group, m, n, p, i, x, rows=nz == CSR)
    elif nz >= 0:
        csr = _triplet(group, m, n, nz, p, i, x)
    else:
        raise group.error("nz", f"is {nz}, expected -2 (rows), -1 (columns) or the count of a triplet matrix")
    if packed or group.flagged("symmetric_packed"):
        csr = _unpack(group, csr)
    return matrices.settle(csr)


def write_sparse(
    parent: h5py.Group, name: str, M: Matrix, *, compress: bool, triplet: bool = False, int32: bool = False
) -> h5py.Group:
    """Write `M` as an FCLIB group: compressed rows, or a triplet in CSparse order.

    A dense matrix keeps every entry that is not +0, so that it comes back bit for bit. `int32` refuses (with
    OverflowError) what FCLIB's C reader cannot index.
    """
    csr = _pattern(M)
    group = parent.create_group(name)
    m, n = csr.shape
    count = int(csr.nnz)
    wide = max(m, n, count) > _INT32
    if wide and int32:
        raise OverflowError(f"{name} is {m}x{n} with {count} entries, FCLIB counts with 32 bits")
    index = np.int64 if wide else np.int32
    for key, value in (("nzmax", count), ("m", m), ("n", n), ("nz", count if triplet else CSR)):
        put_integer(group, key, value)
    if triplet:
        rows = np.repeat(np.arange(m, dtype=index), np.diff(csr.indptr))
        put_array(group, "p", csr.indices.astype(index, copy=False), compress=compress)
        put_array(group, "i", rows, compress=compress)
    else:
        put_array(group, "p", csr.indptr.astype(index, copy=False), compress=compress)
        put_array(group, "i", csr.indices.astype(index, copy=False), compress=compress)
    put_array(group, "x", csr.data, compress=compress)
    return group


def write_matrix(parent: h5py.Group, name: str, M: Matrix, *, compress: bool) -> None:
    """Write `M` in its own storage: a group when sparse, a 2-D data set when dense."""
    if matrices.is_sparse(M):
        write_sparse(parent, name, M, compress=compress)
    else:
        put_array(parent, name, matrices.dense(M), compress=compress)


def _pattern(M: Matrix) -> Sparse:
    if matrices.is_sparse(M):
        return matrices.sparse(M)
    D = matrices.dense(M)
    kept = (D != 0) | np.signbit(D)
    indptr = np.concatenate([[0], np.cumsum(kept.sum(axis=1))])
    return sp.csr_array((D[kept], np.nonzero(kept)[1], indptr), shape=D.shape)


def _require_shape(tree: Tree, name: str, got: tuple[int, ...], wanted: tuple[int | None, int | None]) -> None:
    if any(w is not None and g != w for g, w in zip(got, wanted, strict=True)) or min(got) < 0:
        shown = "x".join("any" if w is None else str(w) for w in wanted)
        raise tree.error(name, f"is {got[0]}x{got[1]}, expected {shown}")


def _compressed(
    group: Tree, m: int, n: int, p: NDArray[Any], i: NDArray[Any], x: NDArray[Any], *, rows: bool
) -> Sparse:
    major, minor = (m, n) if rows else (n, m)
    what = "row" if rows else "column"
    if p.size != major + 1:
        raise group.error("p", f"has {p.size} {what} pointers, expected {major + 1}")
    if p[0] != 0 or (np.diff(p) < 0).any():
        raise group.error("p", f"is not a list of {what} pointers: expected 0 first, then no decrease")
    count = int(p[-1])
    _require_entries(group, count, i, x)
    _require_range(group, "i", i[:count], minor)
    index = np.result_type(p, i)  # SciPy wants one type, and looks at the numbers of the wider one
    parts: Any = (x[:count], i[:count].astype(index, copy=False), p.astype(index, copy=False))
    return sp.csr_array(parts, shape=(m, n)) if rows else sp.csr_array(sp.csc_array(parts, shape=(m, n)))


def _triplet(group: Tree, m: int, n: int, nz: int, p: NDArray[Any], i: NDArray[Any], x: NDArray[Any]) -> Sparse:
    _require_entries(group, nz, i, x)
    if p.size < nz:
        raise group.error("p", f"has {p.size} numbers, expected nz = {nz}")
    row, col = i[:nz], p[:nz]
    if nz and (row.max() >= m or col.max() >= n) and (col.max() < m and row.max() < n):
        logger.warning(
            "%s: %s: i and p are swapped (row %d of %d, column %d of %d): read p as rows",
            *(group.path, group.where, row.max(), m, col.max(), n),
        )
        row, col = col, row
    _require_range(group, "i", row, m)
    _require_range(group, "p", col, n)
    return sp.csr_array(sp.coo_array((x[:nz], (row, col)), shape=(m, n)))


def _require_entries(group: Tree, count: int, i: NDArray[Any], x: NDArray[Any]) -> None:
    for name, array in (("i", i), ("x", x)):
        if array.size < count:
            raise group.error(name, f"has {array.size} numbers, expected {count}")


def _require_range(group: Tree, name: str, index: NDArray[Any], limit: int) -> None:
    unsigned = index.view(f"u{index.itemsize}")  # one look: a negative index is a large one
    if index.size and unsigned.max() >= limit:
        bad = int(index.min() if index.min() < 0 else index.max())
        raise group.error(name, f"holds the index {bad}, expected 0 to {limit - 1}")


def _unpack(group: Tree, lower: Sparse) -> Sparse:
    if lower.shape[0] != lower.shape[1]:
        raise group.error("", f"is symmetric_packed but {lower.shape[0]}x{lower.shape[1]}, expected a square matrix")
    above = sp.triu(lower, 1)
    if above.nnz:
        raise group.error("", f"is symmetric_packed but has {above.nnz} entries above the diagonal, expected none")
    return sp.csr_array(lower + sp.tril(lower, -1).T)
