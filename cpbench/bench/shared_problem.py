"""A problem on its way from the referee to the workers: one file of raw numbers, gone after the block.

Not a format of problems: the referee alone writes it, and a worker of the same run reads it at once, at the speed of
memory. What solvers do not look at (info, provenance, geometry of contacts) stays behind.

A file is one of `frames`, its arrays aligned, so that compiled loops meet them as they meet arrays of NumPy's own.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.base import Problem, formulations
from cpbench.formulations.expressions import Map
from cpbench.foundation import frames, matrices

ALIGNED = 64


def write(problem: Problem, path: str | Path) -> None:
    """Write a problem to a file that solvers map; raises OSError."""
    data, maps = problem.data(), problem.maps()
    parts = {name: list(_arrays(matrix)) for name, matrix in data.items()}
    parts |= {name: list(F.arrays().values()) for name, F in maps.items()}
    header = {
        "node": problem.node,
        "name": problem.name,
        "fields": problem.settings(),
        "shapes": {name: matrix.shape for name, matrix in data.items()},
        "inputs": {name: F.inputs for name, F in maps.items()},
    }
    arrays = {f"{name}.{k}": array for name, pieces in parts.items() for k, array in enumerate(pieces)}
    with open(path, "wb") as file:
        file.writelines(frames.parts(header, arrays, ALIGNED))


def read(path: str | Path) -> Problem:
    """Return the problem of a file that `write` made; raises OSError, and ValueError when it is none."""
    whole = np.fromfile(path, np.uint8)
    whole.flags.writeable = False
    header, arrays = frames.unpack(whole, types=frames.NUMBERS, aligned=ALIGNED)
    pieces: dict[str, list[Any]] = {}
    for name, array in arrays.items():
        pieces.setdefault(name.rpartition(".")[0], []).append(array)
    parts = {name: _matrix(pieces[name], tuple(shape)) for name, shape in header["shapes"].items()}
    parts |= {name: Map(inputs, *pieces[name]) for name, inputs in header["inputs"].items()}
    return formulations.get(header["node"])(name=header["name"], **parts, **header["fields"])


def _arrays(matrix: Any) -> Iterator[Any]:
    """Yield the numbers of a matrix or vector; those of a CSR with its indices."""
    if isinstance(matrix, sp.csr_array):
        yield from (matrix.data, matrix.indices, matrix.indptr)
    else:
        yield matrix


def _matrix(arrays: list[Any], shape: tuple[int, ...]) -> Any:
    if len(arrays) == 1:
        return arrays[0].reshape(shape)
    return matrices.adopt(sp.csr_array(tuple(arrays), shape=shape))  # as it was in a problem before
