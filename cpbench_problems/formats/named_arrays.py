"""The arrays of a problem by name, and their shapes compared with a form before and after they are read."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import FormatError
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix, Vector
from cpbench.storage.arrays import SPARSE, sparse_from_parts
from cpbench_problems.formats.array_forms import ArrayForm, Symbols

Shape = tuple[int, ...]


@dataclass(frozen=True)
class NamedArrays:
    """Arrays of a file, or of several, by name."""

    path: Path
    values: Mapping[str, Any]

    def __contains__(self, name: str) -> bool:
        return name in self.values

    def matrix(self, name: str, columns: int | None = None) -> Any:
        """Return the matrix `name`, without rows where it is absent and `columns` are given; a vector is one row.

        Raises FormatError.
        """
        if name not in self.values and columns is not None:
            return np.zeros((0, columns))
        value = self.values[name]
        if value.ndim < 2 and value.dtype.kind in "biuf":
            value = value.reshape(1, -1)
        if value.dtype.kind not in "biuf" or value.ndim != 2:
            raise self.error(name, f"{_held(value)}, expected a matrix of numbers")
        return value.astype(np.float64)

    def symmetric(self, name: str) -> Matrix:
        """Return the matrix `name`, which has to be symmetric; raises FormatError where it is one triangle."""
        return require_whole(self.path, name, self.matrix(name))

    def vector(self, name: str, size: int = 0, fill: float = 0.0) -> Vector:
        """Return the vector `name`, which may be a row or a column; when absent, `size` times `fill`.

        Raises FormatError.
        """
        if name not in self.values:
            return np.full(size, fill)
        value = self.values[name]
        if value.dtype.kind not in "biuf" or _flat(value.shape) is None:
            raise self.error(name, f"{_held(value)}, expected a vector of numbers")
        return np.asarray(matrices.dense(value), np.float64).reshape(-1)

    def number(self, name: str, otherwise: float) -> float:
        """Return the one number in `name`; `otherwise` where it is absent. Raises FormatError."""
        if name not in self.values:
            return otherwise
        vector = self.vector(name)
        if vector.size != 1:
            raise self.error(name, f"has {vector.size} numbers, expected one")
        return float(vector[0])

    def error(self, name: str, cause: str) -> FormatError:
        return FormatError(self.path, name, cause)


def require_whole(path: Path, name: str, M: Any) -> Any:
    """Return a matrix that has to be symmetric; raises FormatError where it is one triangle, as OSQP, Clarabel and SCS
    take it, or two that differ."""
    if M.shape[0] == M.shape[1] and not matrices.is_symmetric(M):
        entries = sp.coo_array(M)
        entries.eliminate_zeros()
        above, below = bool((entries.row < entries.col).any()), bool((entries.row > entries.col).any())
        cause = f"the quadratic term has the sum of {name}[i, j] and {name}[j, i], a package may read one of them alone"
        if above != below:
            cause = (
                f"the {'lower' if above else 'upper'} triangle is empty; store {name} + {name}.T - diag(diag({name}))"
            )
        todo = f"cpbench pack {path.name} --symmetric part (or upper, or lower) -o NEW.h5"
        raise FormatError(path, name, f"is not symmetric: {cause}: {todo}")
    return M


def symmetrized(M: Any, how: str) -> Any:
    """Return (M + Mᵀ)/2 for `part`, else the symmetric matrix of which M has the upper or the lower triangle."""
    if how == "part":
        return (M + M.T) / 2.0
    half = sp.csr_array((sp.triu if how == "upper" else sp.tril)(sp.csr_array(M)))
    whole = sp.csr_array(half + half.T - sp.diags_array(half.diagonal()))
    return whole if matrices.is_sparse(M) else whole.toarray()


def _held(value: Any) -> str:
    return f"holds {value.dtype} of shape {value.shape}"


def joined(path: Path, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arrays with the parts of each sparse matrix put together; raises FormatError."""
    result = dict(values)
    for name in sparse_names(result):
        parts = {part: result.pop(f"{name}.{part}") for part in (*SPARSE, "format") if f"{name}.{part}" in result}
        result[name] = sparse_from_parts(path, f"{name}.", counted(parts))
    return result


def counted(parts: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parts of a sparse matrix with indices as whole numbers, which text and MATLAB keep as any number."""

    def whole(array: Any) -> Any:
        exact = array.dtype.kind == "f" and bool((abs(array) < 2.0**53).all()) and bool((array == array.round()).all())
        return array.astype(np.int64) if exact else array

    return {part: array if part == "data" else whole(np.asarray(array)) for part, array in parts.items()}


def joined_shapes(shapes: Mapping[str, Shape]) -> dict[str, Shape | None]:
    """Return the shapes with the parts of each sparse matrix as one matrix, whose shape is not known."""
    result: dict[str, Shape | None] = dict(shapes)
    for name in sparse_names(shapes):
        for part in (*SPARSE, "format"):
            result.pop(f"{name}.{part}", None)
        result[name] = None
    return result


def sparse_names(names: Collection[str]) -> list[str]:
    """Return the names of sparse matrices whose parts are all there."""
    stems = [name.removesuffix(".data") for name in names if name.endswith(".data")]
    return [stem for stem in stems if all(f"{stem}.{part}" in names for part in SPARSE)]


def require_shapes(path: Path, form: ArrayForm, shapes: Mapping[str, Shape | None]) -> None:
    """Raise FormatError where the shapes of arrays do not agree with each other as the form says."""
    known: dict[str, tuple[int, str]] = {}
    for name, symbols, shape in sorted(_declared(form, shapes), key=lambda item: len(item[1])):
        free = [symbol for symbol in symbols if not symbol[0].isdigit()]
        if len(free) == 2 and free[0] == free[1] and shape[0] != shape[1] and free[0] not in known:
            raise FormatError(path, name, f"is {_shown(shape)}, expected a square matrix")
        wanted = tuple(
            int(symbol) if symbol[0].isdigit() else known[symbol][0] if symbol in known else size
            for symbol, size in zip(symbols, shape, strict=True)
        )
        if shape != wanted:
            wrong = [s for s, size, right in zip(symbols, shape, wanted, strict=True) if size != right]
            sources = dict.fromkeys(known[s][::-1] for s in wrong if s in known)
            why = ", ".join(f"{source} has {size} numbers" for source, size in sources)
            raise FormatError(
                path, name, f"{_is(shape)}, expected {'x'.join(map(str, wanted))}{f' ({why})' if why else ''}"
            )
        for symbol, size in zip(symbols, shape, strict=True):
            known.setdefault(symbol, (size, name))


def _declared(form: ArrayForm, shapes: Mapping[str, Shape | None]) -> Iterator[tuple[str, Symbols, Shape]]:
    """Yield each array with the dimensions of the form and its shape, vectors flat; leave out what has another rank,
    which is refused when it is taken."""
    dropped = absent(form, shapes)
    for name, symbols in form.arrays.items():
        shape = shapes.get(name)
        if shape is None or not symbols or name in dropped:
            continue
        if len(symbols) == 1:
            flat = _flat(shape)
            shape = None if flat is None else (flat,)
        if shape is not None and len(shape) == len(symbols):
            yield name, symbols, shape


def _flat(shape: Shape) -> int | None:
    """Return the size of an array of one number, a vector, a row or a column; None for a matrix."""
    size = int(np.prod(shape, dtype=object))
    return size if size == max(shape, default=1) or (size == 0 and len(shape) <= 2) else None


def _is(shape: Shape) -> str:
    return f"is {_shown(shape)}" if len(shape) == 2 else f"has {_shown(shape)}"


def _shown(shape: Shape) -> str:
    return "x".join(map(str, shape)) if len(shape) == 2 else f"{shape[0]} numbers"


def absent(form: ArrayForm, shapes: Mapping[str, Shape | None]) -> set[str]:
    """Return the arrays without numbers, as MATLAB's [], that stand for parts that are not there: with all that belong
    together."""

    def empty(name: str) -> bool:
        shape = shapes[name]
        return shape is not None and 0 in shape

    return {
        name
        for name in (shapes.keys() & set(form.known())) - form.needs - form.any_of
        if all(empty(n) for n in {name, *(n for group in form.groups if name in group for n in group)} & shapes.keys())
    }


def shapes_of(values: Mapping[str, Any]) -> dict[str, Shape]:
    """Return the shape of each array."""
    return {name: tuple(value.shape) for name, value in values.items()}
