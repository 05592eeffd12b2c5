"""`npy-map`: the folder of `npy-dir`, and every nonlinear map F beside it as the list of operations that it is.

A map F of n unknowns is the arrays F.inputs (n, alone), F.constants, F.heads, F.left, F.right and F.outputs of `Map`;
its Jacobian is one more map, to the entries of a CSR, in F.jacobian.constants and so on, with F.jacobian.indices and
F.jacobian.indptr. What the heads mean is in `cpbench.formulations.expressions.operators`, which needs NumPy alone.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.errors import FormatError, ProblemError
from cpbench.formulations.base import Problem
from cpbench.formulations.exchange import exchanges
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.derivatives import derivative
from cpbench.storage.exchanges.arrays import NpyFolder

_PARTS = ("inputs", "constants", "heads", "left", "right", "outputs")


class NpyMaps(NpyFolder):
    """`npy-dir` with maps."""

    name = "npy-map"
    summary = "npy-dir, nonlinear maps and their Jacobians as lists of operations"
    maps = True

    def _put_maps(self, problem: Problem) -> Mapping[str, NDArray[Any]]:
        arrays: dict[str, NDArray[Any]] = {}
        for name, F in problem.maps().items():
            entries, indices, indptr = derivative(F)
            arrays |= _listed(name, F) | _listed(f"{name}.jacobian", entries)
            arrays |= {f"{name}.jacobian.indices": indices, f"{name}.jacobian.indptr": indptr}
        return arrays

    def _get_maps(self, path: Path, cls: type[Problem]) -> Mapping[str, Map]:
        result: dict[str, Map] = {}
        for name in (f.name for f in dataclasses.fields(cls) if "map" in f.metadata):
            arrays, _ = self._get(path, [f"{name}.{part}" for part in _PARTS])
            lacking = [f"{name}.{part}" for part in _PARTS if f"{name}.{part}" not in arrays]
            if lacking:
                raise FormatError(path, lacking[0], "is missing, expected a part of a map")
            inputs, constants, *whole = (arrays[f"{name}.{part}"] for part in _PARTS)
            if inputs.shape != (1,) or not all(np.issubdtype(a.dtype, np.integer) for a in (inputs, *whole)):
                raise FormatError(path, name, "is not a list of operations: its numbers are not whole")
            try:
                result[name] = Map(int(inputs[0]), constants, whole[0], whole[1], whole[2], whole[3])
            except (ProblemError, ValueError, TypeError) as cause:
                raise FormatError(path, name, f"is not a map ({cause})") from None
        return result


def _listed(name: str, F: Map) -> dict[str, NDArray[Any]]:
    return {f"{name}.inputs": np.array([F.inputs])} | {f"{name}.{part}": array for part, array in F.arrays().items()}


exchanges.add(NpyMaps.name, NpyMaps())
