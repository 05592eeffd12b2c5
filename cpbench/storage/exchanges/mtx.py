"""`mtx`: a folder of Matrix Market files, which nearly every language reads.

A matrix NAME is NAME.mtx: `coordinate` where it is sparse, `array` (column by column) where it is dense. A vector NAME
is NAME.mtx, an `array` of one column; infinite bounds are inf and -inf. problem.json has node, name and the plain
fields of the node, as in `npy-dir`. An answer is a folder with one NAME.mtx for every part of the node's point; parts
that are empty may be left out. Numbers are written so that they come back bit for bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from cpbench.errors import FormatError
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.exchange import Exchange, exchanges
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.storage.arrays import read_matrix, read_vector
from cpbench.storage.exchanges import header
from cpbench.storage.exchanges.header import HEADER


class MatrixMarket(Exchange):
    """A folder with a text file for every array."""

    name = "mtx"
    summary = "a folder of Matrix Market files and problem.json"

    def write_problem(self, problem: Problem, path: Path, dense: bool = False) -> None:
        files = {HEADER: header.encode(problem)}
        for name, value in problem.data().items():
            files[f"{name}.mtx"] = encode(matrices.dense(value) if dense else value)
        _put(path, files)

    def read_problem(self, path: Path) -> Problem:
        try:
            text = (path / HEADER).read_bytes()
        except OSError as cause:
            raise FormatError(path, HEADER, f"cannot be read ({cause.strerror or cause})") from None
        cls, fields, data = header.decode(path, text)
        parts: dict[str, Any] = {}
        for name in data:
            file = path / f"{name}.mtx"
            if file.exists():
                flat = len(cls.__dataclass_fields__[name].metadata["shape"]) == 1
                parts[name] = read_vector(file) if flat else read_matrix(file)
        return header.assemble(path, cls, fields, parts)

    def write_answer(self, point: Point, path: Path) -> None:
        _put(path, {f"{name}.mtx": encode(value) for name, value in point.arrays().items()})

    def read_answer(self, path: Path, problem: Problem) -> Any:
        if not path.is_dir():
            raise FormatError(path, "", "is a file, expected a folder" if path.exists() else "no such folder")
        parts: dict[str, Vector] = {}
        for name, size in problem.point_sizes.items():
            file = path / f"{name}.mtx"
            if not size and not file.exists():
                parts[name] = np.zeros(0)
                continue
            parts[name] = read_vector(file)
            if parts[name].size != size:
                raise FormatError(file, "", f"has {parts[name].size} numbers, expected {size}")
        return problem.point_type(**parts)


def encode(value: Matrix | Vector) -> bytes:
    """Encode an array as a Matrix Market file."""
    return "\n".join((*_lines(value), "")).encode()


def _lines(value: Any) -> Iterator[str]:
    if matrices.is_sparse(value):
        yield "%%MatrixMarket matrix coordinate real general"
        yield f"{value.shape[0]} {value.shape[1]} {value.nnz}"
        at = value.tocoo()
        for i, j, x in zip((at.row + 1).tolist(), (at.col + 1).tolist(), at.data.tolist(), strict=True):
            yield f"{i} {j} {x!r}"
        return
    columns = value.reshape(-1, 1) if value.ndim == 1 else value
    yield "%%MatrixMarket matrix array real general"
    yield f"{columns.shape[0]} {columns.shape[1]}"
    yield from map(repr, columns.ravel(order="F").tolist())


def _put(path: Path, files: dict[str, bytes]) -> None:
    try:
        path.mkdir(exist_ok=True)
        for left in path.iterdir():  # no array of the problem before may be read
            left.unlink()
        for name, data in files.items():
            (path / name).write_bytes(data)
    except OSError as cause:
        raise FormatError(path, "", f"cannot be written ({cause.strerror or cause})") from None


exchanges.add("mtx", MatrixMarket())
