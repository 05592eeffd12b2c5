"""Bare matrices and vectors: .npy, .npz, Matrix Market, and text. Nothing is ever unpickled."""

from __future__ import annotations

import contextlib
import io
import pickletools
import re
import warnings
import zipfile
from collections.abc import Callable, Generator
from pathlib import Path
from typing import IO, Any

import numpy as np
import scipy.sparse as sp
from numpy.lib import format as npy
from numpy.typing import NDArray

from cpbench.errors import FormatError
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.storage.base import read_head, read_text

SPARSE = ("data", "indices", "indptr", "shape")
"""Parts of a sparse matrix NAME: NAME.data, NAME.indices, NAME.indptr, NAME.shape."""
_EXPANSION = 1100
"""Deflate cannot expand by more than 1032."""


def read_matrix(path: str | Path) -> Matrix:
    """Read a matrix from .npy, .npz (scipy.sparse, or one array), .mtx or text; raises FormatError."""
    file = Path(path)
    value: Any = _read(file)
    if value.ndim != 2:
        raise FormatError(file, "", f"has shape {value.shape}, expected a matrix")
    return value


def read_vector(path: str | Path) -> Vector:
    """Read a vector from .npy, .npz (one array), .mtx or text; one row or one column will do. Raises FormatError."""
    file = Path(path)
    value: Any = _read(file)
    if value.ndim == 2 and 1 in value.shape:
        value = matrices.dense(value).reshape(-1)
    if value.ndim != 1:
        raise FormatError(file, "", f"has shape {value.shape}, expected a vector")
    return value


def read_array(path: str | Path) -> Any:
    """Read an array of any number of dimensions, or a sparse matrix; raises FormatError."""
    return _read(Path(path))


def read_npz(
    path: Path, optional: frozenset[str] = frozenset(), objects: Callable[[bytes], dict[str, Any] | None] | None = None
) -> dict[str, NDArray[Any]]:
    """Read the arrays of an .npz by name; raises FormatError on anything that is not plain numbers or text.

    An entry of `optional` that holds a pickled None (NumPy's way to write an absent array) is left out: its
    pickle is compared with that of None, opcode by opcode, and never run. `objects` may read the parts NAME.part of an
    entry off another pickle.
    """
    arrays: dict[str, NDArray[Any]] = {}
    with _archive(path) as archive:
        for entry in archive.infolist():
            name = entry.filename.removesuffix(".npy")
            # before it is unpacked: a bomb of zeros declares gigabytes in kilobytes
            if entry.file_size > _EXPANSION * max(entry.compress_size, 1):
                raise FormatError(path, name, f"declares {entry.file_size} bytes from {entry.compress_size}")
            with archive.open(entry) as stream:
                dtype = _npy_header(path, name, stream, entry.file_size)[2]
                start = stream.tell()
            data = archive.read(entry)
            parts = objects(data[start:]) if objects and dtype.hasobject else None
            if parts is not None:
                arrays |= {f"{name}.{part}": array for part, array in parts.items()}
                continue
            array = read_npy(path, name, data, may_be_none=name in optional)
            if array is not None:
                arrays[name] = array
    return arrays


def npz_shapes(path: Path) -> dict[str, tuple[int, ...]]:
    """Return the shapes that the arrays of an .npz declare without reading them, (0,) for Python objects, which may be
    None; raises FormatError."""
    shapes: dict[str, tuple[int, ...]] = {}
    with _archive(path) as archive:
        for entry in archive.infolist():
            name = entry.filename.removesuffix(".npy")
            with archive.open(entry) as stream:
                shape, _, dtype = _npy_header(path, name, stream, entry.file_size)
                shapes[name] = (0,) if dtype.hasobject else shape
    return shapes


@contextlib.contextmanager
def _archive(path: Path) -> Generator[zipfile.ZipFile]:
    """Open an .npz; what zipfile raises on a damaged one, which may be anything, becomes a FormatError."""
    read_head(path)
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except FormatError:
        raise
    except Exception as cause:
        raise FormatError(path, "", f"is not a readable .npz archive ({first_line(cause)})") from cause


def sparse_from_parts(path: Path, where: str, parts: dict[str, NDArray[Any]]) -> sp.csr_array:
    """Build a CSR (or CSC, where `format` says so) matrix from data, indices, indptr, shape; raises FormatError."""
    shape = tuple(int(s) for s in np.ravel(parts["shape"]))
    kind = bytes(np.ravel(parts["format"])[0]).decode() if "format" in parts else "csr"
    if len(shape) != 2 or kind not in ("csr", "csc"):
        raise FormatError(path, where, f"is a {kind} matrix of shape {shape}, expected csr or csc with two dimensions")
    data, indices, indptr = (np.ravel(parts[k]) for k in ("data", "indices", "indptr"))
    major, minor = shape if kind == "csr" else shape[::-1]
    if indices.dtype.kind not in "iu" or indptr.dtype.kind not in "iu":
        raise FormatError(path, where, "has indices that are not whole numbers")
    if indptr.size != major + 1 or indptr[0] != 0 or (np.diff(indptr.astype(np.int64)) < 0).any():
        raise FormatError(path, f"{where}indptr", f"is not a list of {major + 1} increasing pointers from 0")
    if not data.size == indices.size == indptr[-1]:
        raise FormatError(path, f"{where}data", f"has {data.size} numbers, expected {int(indptr[-1])}")
    if indices.size and (indices.min() < 0 or indices.max() >= minor):
        raise FormatError(path, f"{where}indices", f"hold {int(indices.max())}, expected 0 to {minor - 1}")
    # as CSR it gets a pointer a row: a file of a few bytes could ask for gigabytes
    if kind == "csc" and major * 1000 + 10**6 < minor:
        raise FormatError(path, where, f"has shape {shape} and {indices.size} entries: not believed")
    triple: Any = (data.astype(np.float64), indices, indptr)
    return sp.csr_array(triple, shape=shape) if kind == "csr" else sp.csr_array(sp.csc_array(triple, shape=shape))


def _read(path: Path) -> Any:
    suffix = path.suffix.lower()
    if suffix == ".npy":
        read_head(path)
        return _numbers(path, "", read_npy(path, "", path.read_bytes()))
    if suffix == ".npz":
        arrays = read_npz(path)
        if set(arrays) >= set(SPARSE):
            return sparse_from_parts(path, "", arrays)
        if len(arrays) != 1:
            raise FormatError(
                path, "", f"holds {', '.join(arrays) or 'nothing'}: expected one array or a sparse matrix"
            )
        return _numbers(path, *next(iter(arrays.items())))
    if suffix == ".mtx":
        return _read_mtx(path)
    return _read_rows(path)


def _numbers(path: Path, name: str, array: NDArray[Any] | None) -> NDArray[Any]:
    if array is None or array.dtype.kind not in "biuf":
        raise FormatError(path, name, f"holds {'nothing' if array is None else array.dtype}, expected numbers")
    return array.astype(np.float64)


def read_npy(path: Path, name: str, data: bytes, *, may_be_none: bool = False) -> NDArray[Any] | None:
    """Read one array in NumPy's format; the size in its header is compared with the bytes before reading."""
    stream = io.BytesIO(data)
    shape, fortran, dtype = _npy_header(path, name, stream, len(data))
    if dtype.hasobject:
        if may_be_none and shape == () and _is_pickled_none(data[stream.tell() :]):
            return None
        raise FormatError(path, name, "holds Python objects: they are never loaded, expected numbers")
    flat = np.frombuffer(data, dtype, offset=stream.tell()) if len(data) > stream.tell() else np.empty(0, dtype)
    return flat.reshape(shape, order="F" if fortran else "C").copy()


def _npy_header(path: Path, name: str, stream: IO[bytes], size: int) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return the shape, order and type of an array of `size` bytes; raises FormatError where it declares another
    size.
    """
    try:
        with warnings.catch_warnings(action="ignore"):  # of Python on what it takes for a program
            version = npy.read_magic(stream)
            header = npy.read_array_header_1_0(stream) if version == (1, 0) else npy.read_array_header_2_0(stream)
    except Exception as cause:  # NumPy takes a header for Python, and raises what Python does
        raise FormatError(path, name, f"is not an array in NumPy's .npy format ({first_line(cause)})") from cause
    shape, fortran, dtype = header
    held = size - stream.tell()
    # in Python's integers, which do not overflow to something that fits
    declared = int(np.prod(shape, dtype=object)) * dtype.itemsize
    if declared != held and not dtype.hasobject:
        raise FormatError(path, name, f"declares {declared} bytes, the file holds {held} of them")
    return shape, fortran, dtype


def first_line(cause: BaseException) -> str:
    """Return the beginning of what an exception says, its class where it says nothing."""
    return next(iter(str(cause).splitlines()), type(cause).__name__)[:100]


def _is_pickled_none(data: bytes) -> bool:
    """Return whether a pickle is that of ``np.array(None, dtype=object)``, by reading its opcodes only."""
    import pickle

    try:
        opcodes = _opcodes(data)
    except (ValueError, IndexError):
        return False
    # NumPy has written it by each of these protocols
    return any(opcodes == _opcodes(pickle.dumps(np.array(None, dtype=object), protocol)) for protocol in (2, 3, 4))


def _opcodes(data: bytes) -> list[tuple[str, Any]]:
    """Return opcodes with their arguments, but for framing, memo numbers and the two names of NumPy's core."""
    kept: list[tuple[str, Any]] = []
    for opcode, argument, _ in pickletools.genops(data):
        if opcode.name in ("PROTO", "FRAME", "MEMOIZE") or "PUT" in opcode.name:
            continue
        kept.append(
            (opcode.name, argument.replace("numpy._core", "numpy.core") if isinstance(argument, str) else argument)
        )
    return kept


def _read_mtx(path: Path) -> Any:
    """Read a CSR matrix from a coordinate file, an array from an array file."""
    import scipy.io

    read_head(path)
    try:
        value = scipy.io.mmread(path, spmatrix=False)
    except (ValueError, TypeError, OverflowError, MemoryError) as cause:
        raise FormatError(path, "", f"is not a readable Matrix Market file ({first_line(cause)})") from None
    if value.dtype.kind not in "biuf":
        raise FormatError(path, "", f"holds {value.dtype}, expected real numbers")
    return sp.csr_array(value, dtype=np.float64) if sp.issparse(value) else value.astype(np.float64)


def _read_rows(path: Path) -> NDArray[Any]:
    """Read rows of numbers between commas, semicolons or blanks; skip '#' comments and a first line of titles."""
    # not Python's blanks and ends of lines: in Latin-1 some stand within numbers (the blank that does not break)
    split = (re.findall(r"[^,; \t\f]+", line.split("#")[0]) for line in re.split(r"\r\n?|\n", read_text(path)))
    rows = [row for row in split if row]
    if rows and not _is_number(rows[0][0]):
        rows = rows[1:]
    if not rows:
        raise FormatError(path, "", "holds no numbers")
    width = len(rows[0])
    for k, row in enumerate(rows):
        if len(row) != width:
            raise FormatError(path, f"row {k + 1}", f"has {len(row)} numbers, expected {width} as in the first row")
    try:
        return np.array([list(map(float, row)) for row in rows])
    except ValueError as cause:
        raise FormatError(path, "", f"holds something that is not a number ({cause})") from None


def _is_number(token: str) -> bool:
    try:
        float(token)
    except ValueError:
        return False
    return True
