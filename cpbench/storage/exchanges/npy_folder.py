"""`npy-dir`: a folder with the arrays of a problem under their names in the mathematics, in NumPy's .npy format.

A dense array NAME is NAME.npy (float64, C order). A sparse matrix NAME is the four arrays of its CSR: NAME.data.npy
(float64), NAME.indices.npy, NAME.indptr.npy and NAME.shape.npy (int64). The rest stands in problem.json: node, name,
and the plain fields of the node (dimension). An answer is one array for every part of the node's point.

A nonlinear map F of n unknowns is the list of operations that it is: F.inputs (n, alone), F.constants, F.heads,
F.left, F.right and F.outputs of `Map`. Its Jacobian is one more map, to the entries of a CSR, in F.jacobian.constants
and so on, with F.jacobian.indices and F.jacobian.indptr. What the heads mean is in
`cpbench.formulations.expressions.operators`, which needs NumPy alone.
"""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.errors import FormatError, ProblemError, UnknownName
from cpbench.formulations.base import ANNOTATIONS, Point, Problem, formulations
from cpbench.formulations.exchange import Exchange, exchanges
from cpbench.formulations.expressions.derivatives import derivative
from cpbench.formulations.expressions.map import LISTED, Map
from cpbench.foundation import matrices
from cpbench.storage.arrays import SPARSE, read_npy, sparse_from_parts
from cpbench.storage.base import build

HEADER = "problem.json"
Arrays = dict[str, NDArray[Any]]


class NpyFolder(Exchange):
    """A folder with a file for every array."""

    name = "npy-dir"
    summary = "a folder of .npy files and problem.json; nonlinear maps and their Jacobians as lists of operations"

    def write_problem(self, problem: Problem, path: Path, dense: bool = False) -> None:
        arrays: Arrays = {}
        for name, value in problem.data().items():
            if isinstance(value, sp.csr_array) and not dense:
                arrays[f"{name}.data"] = value.data
                arrays[f"{name}.indices"] = value.indices.astype(np.int64)
                arrays[f"{name}.indptr"] = value.indptr.astype(np.int64)
                arrays[f"{name}.shape"] = np.array(value.shape, np.int64)
            else:
                arrays[name] = matrices.dense(value)
        for name, F in problem.maps().items():
            entries, indices, indptr = derivative(F)
            arrays |= _operations(name, F) | _operations(f"{name}.jacobian", entries)
            arrays |= {f"{name}.jacobian.indices": indices, f"{name}.jacobian.indptr": indptr}
        _write(path, arrays, _header(problem))

    def read_problem(self, path: Path) -> Problem:
        cls, header = _described(path)
        parts: dict[str, Any] = {}
        for f in dataclasses.fields(cls):
            if "map" in f.metadata:
                parts[f.name] = _read_map(path, f.name)
            elif "shape" in f.metadata:
                sparse = _read(path, [f"{f.name}.{part}" for part in SPARSE])
                if len(sparse) == len(SPARSE):
                    by_part = {name.removeprefix(f"{f.name}."): array for name, array in sparse.items()}
                    parts[f.name] = sparse_from_parts(path, f"{f.name}.", by_part)
                else:
                    parts |= _read(path, [f.name])
                if f.name not in parts and f.default is dataclasses.MISSING:
                    raise FormatError(path, f.name, f"is missing, expected {' x '.join(f.metadata['shape'])} numbers")
        return build(path, cls, "", **parts, **header)

    def write_answer(self, point: Point, path: Path) -> None:
        _write(path, point.arrays(), None)

    def read_answer(self, path: Path, problem: Problem) -> Any:
        sizes = problem.point_sizes
        arrays = _read(path, sizes)
        for name, size in sizes.items():
            if name not in arrays:
                raise FormatError(path, name, f"is missing, expected {size} numbers")
            kind, shape = arrays[name].dtype, arrays[name].shape
            if kind.kind not in "fiub":
                raise FormatError(path, name, f"holds {kind}, expected {size} real numbers")
            if arrays[name].size != size:
                raise FormatError(path, name, f"has shape {shape}, expected {size} numbers")
        return problem.point_type(**{name: arrays[name].astype(np.float64) for name in sizes})


def _header(problem: Problem) -> bytes:
    """Return problem.json: node, name, and the fields of the node that are neither arrays nor maps."""
    return json.dumps({"node": problem.node, "name": problem.name, **problem.settings()}).encode()


def _described(path: Path) -> tuple[type[Problem], dict[str, Any]]:
    """Return the class of the problem in a folder, its name and its plain fields; raises FormatError."""
    _require_folder(path)
    try:
        header = json.loads(_bytes(path, HEADER) or b"")
        cls = formulations.get(header.pop("node"))
        name = str(header.pop("name", ""))
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError, UnknownName) as cause:
        raise FormatError(path, HEADER, f"names no problem ({type(cause).__name__}: {cause})") from None
    plain = {f.name for f in dataclasses.fields(cls) if not {"shape", "map"} & f.metadata.keys()}
    unknown = header.keys() - (plain - ANNOTATIONS)
    if unknown:
        raise FormatError(path, HEADER, f"has {', '.join(sorted(unknown))}, which {cls.node} has not")
    return cls, {"name": name, **header}


def _operations(name: str, F: Map) -> Arrays:
    return {f"{name}.inputs": np.array([F.inputs])} | {f"{name}.{part}": array for part, array in F.arrays().items()}


def _read_map(path: Path, name: str) -> Map:
    files = [f"{name}.{part}" for part in ("inputs", *LISTED)]
    arrays = _read(path, files)
    for file in files:
        if file not in arrays:
            raise FormatError(path, file, "is missing, expected a part of a map")
    inputs, constants, heads, left, right, outputs = (arrays[file] for file in files)
    whole = (inputs, heads, left, right, outputs)
    if inputs.shape != (1,) or not all(np.issubdtype(array.dtype, np.integer) for array in whole):
        raise FormatError(path, name, "is not a list of operations: its numbers are not whole")
    try:
        return Map(int(inputs[0]), constants, heads, left, right, outputs)
    except (ProblemError, ValueError, TypeError) as cause:
        raise FormatError(path, name, f"is not a map ({cause})") from None


def _write(path: Path, arrays: Mapping[str, NDArray[Any]], header: bytes | None) -> None:
    """Put arrays, and the header of a problem, into a folder that holds nothing else then; raises FormatError."""
    try:
        path.mkdir(exist_ok=True)
        for left in path.iterdir():  # no array of the problem before may be read
            left.unlink()
        if header is not None:
            (path / HEADER).write_bytes(header)
        for name, array in arrays.items():
            np.save(path / f"{name}.npy", array, allow_pickle=False)
    except OSError as cause:
        raise FormatError(path, "", f"cannot be written ({cause.strerror or cause})") from None


def _read(path: Path, names: Iterable[str]) -> Arrays:
    """Return those of the arrays that are in a folder; raises FormatError."""
    _require_folder(path)
    arrays: Arrays = {}
    for name in names:
        data = _bytes(path, f"{name}.npy")
        array = read_npy(path, name, data) if data is not None else None
        if array is not None:
            arrays[name] = array
    return arrays


def _require_folder(path: Path) -> None:
    if not path.is_dir():
        raise FormatError(path, "", "is a file, expected a folder" if path.exists() else "no such folder")


def _bytes(folder: Path, name: str) -> bytes | None:
    """Read a file of a folder, None when it is not there; raises FormatError."""
    try:
        with open(os.path.join(folder, name), "rb", buffering=0) as file:
            return file.readall()
    except FileNotFoundError:
        return None
    except OSError as cause:
        raise FormatError(folder, name, f"cannot be read ({cause.strerror or cause})") from None


exchanges.add("npy-dir", NpyFolder())
