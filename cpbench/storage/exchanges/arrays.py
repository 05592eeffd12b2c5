"""`npy-dir` and `npz`: the arrays of a problem under their names in the mathematics, each in NumPy's .npy format.

A dense array NAME is NAME.npy (float64, C order). A sparse matrix NAME is the four arrays of its CSR: NAME.data.npy
(float64), NAME.indices.npy, NAME.indptr.npy and NAME.shape.npy (int64). The rest stands in problem.json: node,
name, and the plain fields of the node (dimension). An answer is one array for every part of the node's point.

`npy-dir` is a folder of these files, `npz` one archive of the same names, not compressed; its problem.json is an
array of bytes (uint8), so that every reader of .npz can open it.
"""

from __future__ import annotations

import os
from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.errors import FormatError
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.exchange import Exchange, exchanges
from cpbench.formulations.expressions import Map
from cpbench.foundation import matrices
from cpbench.storage.arrays import read_npy, read_npz, sparse_from_parts
from cpbench.storage.exchanges import header
from cpbench.storage.exchanges.header import HEADER

SPARSE = ("data", "indices", "indptr", "shape")
Arrays = Mapping[str, NDArray[Any]]


class _ArrayExchange(Exchange):
    """Problems and answers as named arrays; where these lie is a subclass's matter."""

    @abstractmethod
    def _put(self, path: Path, arrays: Arrays, header_bytes: bytes | None) -> None:
        """Write arrays, and the header of a problem; raises OSError."""

    @abstractmethod
    def _get(self, path: Path, wanted: Iterable[str]) -> tuple[Arrays, bytes]:
        """Return those of the arrays that are there, and the header (b"" without one); raises FormatError."""

    def _put_maps(self, problem: Problem) -> Arrays:
        """Return the nonlinear maps of a problem as arrays, where the exchange carries any."""
        return {}

    def _get_maps(self, path: Path, cls: type[Problem]) -> Mapping[str, Map]:
        """Return the maps of a problem of class `cls`; raises FormatError."""
        return {}

    def write_problem(self, problem: Problem, path: Path, dense: bool = False) -> None:
        arrays: dict[str, NDArray[Any]] = {}
        for name, value in problem.data().items():
            if isinstance(value, sp.csr_array) and not dense:
                arrays[f"{name}.data"] = value.data
                arrays[f"{name}.indices"] = value.indices.astype(np.int64)
                arrays[f"{name}.indptr"] = value.indptr.astype(np.int64)
                arrays[f"{name}.shape"] = np.array(value.shape, np.int64)
            else:
                arrays[name] = matrices.dense(value)
        arrays |= self._put_maps(problem)
        _written(path, lambda: self._put(path, arrays, header.encode(problem, self.maps)))

    def read_problem(self, path: Path) -> Problem:
        _, text = self._get(path, ())
        cls, fields, data = header.decode(path, text, self.maps)
        arrays, _ = self._get(path, [*data, *(f"{name}.{part}" for name in data for part in SPARSE)])
        parts: dict[str, Any] = {**self._get_maps(path, cls)}
        for key in data:
            sparse = {part: arrays[f"{key}.{part}"] for part in SPARSE if f"{key}.{part}" in arrays}
            if len(sparse) == len(SPARSE):
                parts[key] = sparse_from_parts(path, f"{key}.", sparse)
            elif key in arrays:
                parts[key] = arrays[key]
        return header.assemble(path, cls, fields, parts)

    def write_answer(self, point: Point, path: Path) -> None:
        _written(path, lambda: self._put(path, point.arrays(), None))

    def read_answer(self, path: Path, problem: Problem) -> Any:
        sizes = problem.point_sizes
        arrays, _ = self._get(path, sizes)
        for name, size in sizes.items():
            if name not in arrays:
                raise FormatError(path, name, f"is missing, expected {size} numbers")
            kind, shape = arrays[name].dtype, arrays[name].shape
            if kind.kind not in "fiub":
                raise FormatError(path, name, f"holds {kind}, expected {size} real numbers")
            if arrays[name].size != size:
                raise FormatError(path, name, f"has shape {shape}, expected {size} numbers")
        return problem.point_type(**{name: arrays[name].astype(np.float64) for name in sizes})


class NpyFolder(_ArrayExchange):
    """A folder with a file for every array."""

    name = "npy-dir"
    summary = "a folder of .npy files and problem.json"

    def _put(self, path: Path, arrays: Arrays, header_bytes: bytes | None) -> None:
        path.mkdir(exist_ok=True)
        for left in path.iterdir():  # no array of the problem before may be read
            left.unlink()
        if header_bytes is not None:
            (path / HEADER).write_bytes(header_bytes)
        for name, array in arrays.items():
            np.save(path / f"{name}.npy", array, allow_pickle=False)

    def _get(self, path: Path, wanted: Iterable[str]) -> tuple[Arrays, bytes]:
        if not path.is_dir():
            raise FormatError(path, "", "is a file, expected a folder" if path.exists() else "no such folder")
        arrays: dict[str, NDArray[Any]] = {}
        for name in wanted:
            data = _bytes(path, f"{name}.npy")
            array = read_npy(path, name, data) if data is not None else None
            if array is not None:
                arrays[name] = array
        return arrays, _bytes(path, HEADER) or b""


class NpzFile(_ArrayExchange):
    """One archive with an entry for every array."""

    name = "npz"
    summary = "one .npz archive, problem.json in it as bytes"
    suffix = ".npz"

    def _put(self, path: Path, arrays: Arrays, header_bytes: bytes | None) -> None:
        entries = dict(arrays)
        if header_bytes is not None:
            entries[HEADER] = np.frombuffer(header_bytes, np.uint8)
        with path.open("wb") as file:  # a file, not a name, that savez might add a suffix to
            np.savez(file, allow_pickle=False, **entries)

    def _get(self, path: Path, wanted: Iterable[str]) -> tuple[Arrays, bytes]:
        arrays = read_npz(path)
        header_bytes = arrays.get(HEADER, np.zeros(0, np.uint8))
        return {name: arrays[name] for name in wanted if name in arrays}, header_bytes.tobytes()


def _bytes(folder: Path, name: str) -> bytes | None:
    """Read a file of a folder, None when it is not there; raises FormatError."""
    try:
        with open(os.path.join(folder, name), "rb", buffering=0) as file:
            return file.readall()
    except FileNotFoundError:
        return None
    except OSError as cause:
        raise FormatError(folder, name, f"cannot be read ({cause.strerror or cause})") from None


def _written(path: Path, put: Callable[[], None]) -> None:
    try:
        put()
    except OSError as cause:
        raise FormatError(path, "", f"cannot be written ({cause.strerror or cause})") from None


for _exchange in (NpyFolder(), NpzFile()):
    exchanges.add(_exchange.name, _exchange)
