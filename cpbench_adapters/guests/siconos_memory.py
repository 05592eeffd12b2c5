"""Arrays of a problem as the C structures of Siconos' library (run by the Python that has python3-siconos).

The structures are those of the headers of Siconos 4.4 (FrictionContactProblem.h, MixedLinearComplementarityProblem.h,
...). All memory is malloc'ed, for some solvers free what their caller owns (mlcp_to_lcp), and goes with the process.
"""

from __future__ import annotations

import ctypes
import importlib
from typing import Any

import numpy as np

DENSE, BLOCKS, SPARSE = 0, 1, 2
siconos: Any = importlib.import_module("siconos")
numerics: Any = importlib.import_module("siconos.numerics")
LIBRARY: Any = ctypes.CDLL(numerics._numerics.__file__)  # and through it libsiconos_numerics, whatever its version
LIBC: Any = ctypes.CDLL(None)
LIBC.malloc.restype = ctypes.c_void_p
LIBC.malloc.argtypes = [ctypes.c_size_t]
LIBRARY.NM_create.restype = ctypes.c_void_p
LIBRARY.NM_create.argtypes = [ctypes.c_int] * 3
LIBRARY.NM_triplet_alloc.argtypes = [ctypes.c_void_p, ctypes.c_size_t]
LIBRARY.NM_entry.argtypes = [ctypes.c_void_p, ctypes.c_int, ctypes.c_int, ctypes.c_double]
LIBRARY.SBM_new.restype = ctypes.c_void_p


class SparseRows:
    """A matrix by rows (CSR) as its four arrays; duplicates add up."""

    def __init__(self, data: Any, indices: Any, indptr: Any, shape: Any) -> None:
        self.data, self.columns = data, indices
        self.rows = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
        self.shape = (int(shape[0]), int(shape[1]))

    def toarray(self) -> Any:
        dense = np.zeros(self.shape)
        np.add.at(dense, (self.rows, self.columns), self.data)
        return dense


class NumericsMatrix(ctypes.Structure):
    """The head of the C structure, up to its three storages."""

    _fields_ = [
        *((name, ctypes.c_int) for name in ("storage", "rows", "columns")),
        *((name, ctypes.c_void_p) for name in ("dense", "blocks", "sparse")),
    ]


class SparseBlocks(ctypes.Structure):
    """SparseBlockStructuredMatrix without its last fields, which SBM_new sets."""

    _fields_ = [
        ("nbblocks", ctypes.c_uint),
        ("block", ctypes.c_void_p),
        ("blocknumber0", ctypes.c_uint),
        ("blocknumber1", ctypes.c_uint),
        ("blocksize0", ctypes.c_void_p),
        ("blocksize1", ctypes.c_void_p),
        ("filled1", ctypes.c_size_t),
        ("filled2", ctypes.c_size_t),
        ("index1_data", ctypes.c_void_p),
        ("index2_data", ctypes.c_void_p),
    ]


def copied(values: Any, kind: Any = np.float64) -> int:
    """Return the address of a copy that belongs to C."""
    array = np.ascontiguousarray(values, dtype=kind).ravel()
    address = LIBC.malloc(max(array.nbytes, 8))
    ctypes.memmove(address, array.ctypes.data, array.nbytes)
    return address


def structure(**fields: tuple[Any, Any]) -> int:
    """Return the address of a C structure of the given fields: name=(type, value), in order."""
    kind = type("Structure", (ctypes.Structure,), {"_fields_": [(name, t) for name, (t, _) in fields.items()]})
    instance = kind(*(value for _, value in fields.values()))
    address = LIBC.malloc(ctypes.sizeof(instance))
    ctypes.memmove(address, ctypes.addressof(instance), ctypes.sizeof(instance))
    return address


def matrix(M: Any, storage: str, block: int) -> int:
    """Return a NumericsMatrix in the asked storage: dense, blocks (square ones of `block` rows), or sparse
    (triplets)."""
    if storage == "dense":
        return _dense(M if isinstance(M, np.ndarray) else M.toarray())
    if storage == "blocks":
        return _blocks(M, block)
    return _sparse(M)


def _dense(M: Any) -> int:
    address = LIBRARY.NM_create(DENSE, *M.shape)
    head = NumericsMatrix.from_address(address)
    by_columns = np.asfortranarray(M)
    ctypes.memmove(head.dense, by_columns.ctypes.data, by_columns.nbytes)
    return address


def _triplets(M: Any) -> tuple[Any, Any, Any]:
    if isinstance(M, np.ndarray):
        rows, columns = np.nonzero(M)
        return rows, columns, M[rows, columns]
    return M.rows, M.columns, M.data


def _sparse(M: Any) -> int:
    rows, columns, values = _triplets(M)
    address = LIBRARY.NM_create(SPARSE, *M.shape)
    LIBRARY.NM_triplet_alloc(address, max(len(values), 1))
    for i, j, x in zip(rows.tolist(), columns.tolist(), values.tolist(), strict=True):
        LIBRARY.NM_entry(address, i, j, x)
    return address


def _blocks(M: Any, b: int) -> int:
    """Return block rows with their blocks in order of columns; diagonal blocks are there even if they are zero."""
    rows, columns, values = _triplets(M)
    n = M.shape[0] // b
    keys, at = np.unique(np.concatenate([(rows // b) * n + columns // b, np.arange(n) * (n + 1)]), return_inverse=True)
    data = np.zeros((len(keys), b, b))  # [block, column, row]: every block is stored by columns
    np.add.at(data, (at[: len(values)], columns % b, rows % b), values)
    address = LIBRARY.NM_create(BLOCKS, *M.shape)
    head = NumericsMatrix.from_address(address)
    if not head.blocks:
        head.blocks = LIBRARY.SBM_new()
    sbm = SparseBlocks.from_address(head.blocks)
    sbm.nbblocks, sbm.blocknumber0, sbm.blocknumber1 = len(keys), n, n
    sbm.block = copied([copied(block) for block in data], np.uint64)
    sbm.blocksize0, sbm.blocksize1 = (copied(b * np.arange(1, n + 1), np.uint32) for _ in range(2))
    sbm.filled1, sbm.filled2 = n + 1, len(keys)
    sbm.index1_data = copied(np.searchsorted(keys // max(n, 1), np.arange(n + 1)), np.uint64)
    sbm.index2_data = copied(keys % max(n, 1), np.uint64)
    return address


def read(folder: Any) -> dict[str, Any]:
    """Return the arrays of an npy-dir: NAME.npy, or NAME.data.npy, .indices.npy, .indptr.npy and
    .shape.npy of a CSR; the parts of a map keep their names (F.heads)."""
    data: dict[str, Any] = {}
    for path in sorted(folder.glob("*.npy")):
        name, _, part = path.stem.partition(".")
        if not part:
            data[name] = np.load(path)
        elif part not in ("data", "indices", "indptr", "shape"):
            data[path.stem] = np.load(path)
        elif part == "data":
            parts = (np.load(folder / f"{name}.{p}.npy") for p in ("data", "indices", "indptr", "shape"))
            data[name] = SparseRows(*parts)
    return data


def version() -> str:
    """Return the version that Siconos reports: Debian's 4.4.0 calls itself 4.5.0."""
    return str(siconos.version)
