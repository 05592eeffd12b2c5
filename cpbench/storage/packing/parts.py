"""Matrices and vectors from loose files as a problem: every shape is checked before anything is put in order.

What a formulation declares of its data says which sizes must agree. Vectors come first, since a matrix of the wrong
step is met more often than a vector with a wrong number of rows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cpbench.errors import FormatError, ProblemError
from cpbench.formulations import QP, Problem, formulations
from cpbench.formulations.applications.boxed import boxed_problem
from cpbench.formulations.applications.game import game_problem
from cpbench.formulations.applications.least_squares import least_squares_problem
from cpbench.formulations.contact import ContactProblem
from cpbench.foundation import matrices
from cpbench.storage.half_stored import Half, whole

APPLICATIONS: Mapping[str, tuple[Callable[..., Problem], Mapping[str, tuple[str, ...]]]] = {
    "game": (game_problem, {"A": ("m", "n"), "B": ("m", "n")}),
    "boxed": (
        boxed_problem,
        {"A": ("n", "n"), "b": ("n",), "lo": ("n",), "hi": ("n",), "findex": ("n",)},
    ),
    "least_squares": (least_squares_problem, {"A": ("m", "n"), "b": ("m",), "lb": ("n",), "ub": ("n",)}),
}
"""Problems under another name: what makes them of their parts, and the dimensions of these."""


@dataclass(frozen=True)
class Part:
    """A matrix or vector of a problem, and the file that it comes from."""

    file: Path
    value: Any


def is_matrix(node: str, name: str) -> bool:
    """Return whether the formulation declares this part as a matrix."""
    return len(_symbols(node)[name]) == 2


def build(
    node: str, parts: Mapping[str, Part], axes: str | None, name: str, half: Half | None = None, **place: Any
) -> Problem:
    """Make a problem of its parts; raises FormatError with the file whose shape does not fit those of the others.

    `half` is the triangle that the files hold of symmetric matrices, None for both. `place` goes to a contact problem:
    its step of a sequence, what is known of its contacts.
    """
    _require_shapes(node, parts)
    if node in APPLICATIONS:
        try:
            return APPLICATIONS[node][0](**{part: given.value for part, given in parts.items()}, name=name)
        except ProblemError as cause:
            label = cause.field.rpartition(".")[2]
            file = parts[label].file if label in parts else next(iter(parts.values())).file
            raise FormatError(file, label, cause.cause) from None
    values = {part: _completed(node, part, given, half) for part, given in parts.items()}
    if node == "qp":
        return QP.build(**values, name=name)
    kind = formulations.get(node)
    if not issubclass(kind, ContactProblem):
        return kind(**values, name=name)
    d = _dimension(node, parts, kind.rows_of, axes)
    order = _order(axes, d, values["mu"].size)
    for part, symbols in _symbols(node).items():
        if part in values and "m" in symbols:
            values[part] = _in_order(values[part], order, symbols)
    return kind(**values, dimension=d, name=name, **place)


def _completed(node: str, name: str, part: Part, half: Half | None) -> Any:
    """Return the value of a part, a square matrix with both triangles; raises FormatError."""
    symbols = _symbols(node)[name]
    if len(symbols) != 2 or symbols[0] != symbols[1]:
        return part.value
    return whole(part.file, name, part.value, half, symmetric=name == "Q")


def _symbols(node: str) -> dict[str, tuple[str, ...]]:
    """Return the dimensions of every part, as the formulation declares them."""
    if node in APPLICATIONS:
        return dict(APPLICATIONS[node][1])
    return dict(formulations.get(node).shapes())


def _require_shapes(node: str, parts: Mapping[str, Part]) -> None:
    symbols = _symbols(node)
    known: dict[str, tuple[int, str, Path]] = {}
    for name in sorted(parts, key=lambda part: len(symbols[part])):
        file, shape = parts[name].file, parts[name].value.shape
        if len(shape) == 2 and symbols[name][0] == symbols[name][1] and shape[0] != shape[1]:
            raise FormatError(file, name, f"is {_shown(shape)}, must be square{_as_triples(parts[name].value)}")
        wanted = tuple(known[s][0] if s in known else size for s, size in zip(symbols[name], shape, strict=True))
        if shape != wanted:
            sources = dict.fromkeys(
                known[s] for s, size in zip(symbols[name], shape, strict=True) if known[s][0] != size
            )
            evidence = "; ".join(f"{size} from {part} in {source}" for size, part, source in sources)
            transposed = ", which its transpose is" if shape[::-1] == wanted else ""
            raise FormatError(file, name, f"is {_shown(shape)}, expected {_shown(wanted)}{transposed} ({evidence})")
        for symbol, size in zip(symbols[name], shape, strict=True):
            known.setdefault(symbol, (size, name, file))


def _as_triples(value: Any) -> str:
    """Return what makes Matrix Market of rows, columns and values in three columns; '' where they are none."""
    if value.shape[1] != 3 or matrices.is_sparse(value) or not len(value):
        return ""
    places = value[:, :2]
    if (places < 0).any() or (places != np.floor(places)).any():
        return ""
    base = int(places.min() > 0)
    rows, columns = (int(size) + 1 - base for size in places.max(axis=0))
    counted = "" if base else " and 1 added to each row and column"
    return (
        ": if its lines are row, column, value, it is Matrix Market (.mtx) with the lines '%%MatrixMarket matrix "
        f"coordinate real general' and '{rows} {columns} {len(value)}' before them{counted}"
    )


def _shown(shape: tuple[int, ...]) -> str:
    """Return `12 x 9`, or `9 numbers`."""
    return " x ".join(map(str, shape)) if len(shape) == 2 else f"{shape[0]} numbers"


def _dimension(node: str, parts: Mapping[str, Part], rows_of: str, axes: str | None) -> int:
    """Return rows of a contact; raises FormatError where there are not 2 or 3, or not those that `axes` names."""
    rows, nc = parts[rows_of].value.size, parts["mu"].value.size
    if nc == 0 or rows % nc or rows // nc not in (2, 3):
        raise FormatError(
            parts["mu"].file,
            "mu",
            f"has {nc} numbers, one a contact; expected {rows / 3:.4g} or {rows / 2:.4g}, for 3 or 2 rows a contact "
            f"({rows} rows from {rows_of} in {parts[rows_of].file})",
        )
    d = rows // nc
    if axes is not None and len(axes) != d:
        raise FormatError(
            parts[rows_of].file,
            rows_of,
            f"has {d} rows a contact, --axes {axes} names {len(axes)}: leave it out or mend it",
        )
    return d


def _order(axes: str | None, d: int, nc: int) -> np.ndarray[Any, np.dtype[np.intp]]:
    """Return row numbers that put the normal first."""
    within = np.roll(np.arange(d), 1) if axes and axes.endswith("N") else np.arange(d)
    return (np.arange(nc)[:, None] * d + within).ravel()


def _in_order(value: Any, order: np.ndarray[Any, np.dtype[np.intp]], symbols: tuple[str, ...]) -> Any:
    """Return the rows, the columns, or both, that are rows of contacts, in order."""
    value = matrices.sparse(value) if value.ndim == 2 and matrices.is_sparse(value) else value
    if symbols[0] == "m":
        value = value[order]
    return value[:, order] if symbols[-1] == "m" and len(symbols) == 2 else value
