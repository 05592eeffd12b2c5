"""Sparse matrices that NumPy has written into an .npz as Python objects, as `qpsolvers.Problem.save` does.

A pickle is a program. Here it is run with inert stand-ins for all that it names: nothing is imported or called, and
what it would have made is read off the arguments. Only SciPy's CSC and CSR matrices of numbers come of it.
"""

from __future__ import annotations

import io
import pickle
from typing import Any

import numpy as np

_KINDS = {"csc_matrix": "csc", "csc_array": "csc", "csr_matrix": "csr", "csr_array": "csr"}
_NUMBERS = ("f4", "f8", "i4", "i8")


class _StandIn:
    """Stand-in for what a pickle makes of a class or a function, with its arguments and its state."""

    args: tuple[Any, ...]
    state: Any = None

    def __new__(cls, *args: Any) -> _StandIn:
        instance = object.__new__(cls)
        instance.args = args
        return instance

    def __setstate__(self, state: Any) -> None:
        self.state = state


class _Inert(pickle.Unpickler):
    """An unpickler that imports nothing."""

    def find_class(self, module: str, name: str) -> type[_StandIn]:
        return type(name, (_StandIn,), {})


def sparse_parts(data: bytes) -> dict[str, Any] | None:
    """Return data, indices, indptr, shape and format of the one sparse matrix in a pickled array of objects; None where
    it holds something else."""
    try:
        (matrix,) = _Inert(io.BytesIO(data)).load().state[4]
        state = dict(matrix.state)
        parts = {name: _array(state[name]) for name in ("data", "indices", "indptr")}
        shape = np.array([int(size) for size in state["_shape"]])
    except Exception:  # a pickle that is none may end in any way
        return None
    kind = _KINDS.get(type(matrix).__name__)
    return None if kind is None else {**parts, "shape": shape, "format": np.array(kind.encode())}


def _array(matrix: Any) -> Any:
    """Return the array that `numpy._reconstruct` and a state stand for; raises what a wrong one leads to."""
    _, shape, kind, _, data = matrix.state
    (code, *_), order = kind.args, kind.state[1]
    if code not in _NUMBERS or len(shape) != 1:
        raise ValueError(f"{code} of shape {shape}")
    return np.frombuffer(data, np.dtype(order + code)).reshape(shape).copy()
