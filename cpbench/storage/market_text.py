"""Matrix Market files: `coordinate` (row, column, value; from 1) and `array` (values by columns), of real numbers.

    %%MatrixMarket matrix coordinate|array real|integer|pattern general|symmetric|skew-symmetric|hermitian
    % comments
    rows columns [entries]

Of a matrix that is not general, the lower triangle is there, without its diagonal where it is skew-symmetric. Read
here, not by SciPy, whose reader ends the process on some damaged files.
R. Boisvert, R. Pozo, K. Remington, The Matrix Market Exchange Formats, NISTIR 5935, 1996.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

BANNER = "%%matrixmarket"
_LAYOUTS = ("coordinate", "array")
_FIELDS = ("real", "double", "integer", "unsigned-integer", "pattern")
_SYMMETRIES = ("general", "symmetric", "skew-symmetric", "hermitian")
_EMPTY = 10**7
"""Rows, and columns, beyond one a byte of the file that a sparse matrix may have."""


@dataclass(frozen=True)
class _Head:
    """The first line of a file and its sizes. `body` : what comes after them."""

    layout: str
    field: str
    symmetry: str
    sizes: tuple[int, ...]
    body: str


def parse(text: str) -> Any:
    """Return a CSR matrix from a coordinate file, an array from an array file; raises ValueError."""
    head = _head(text)
    if head.layout == "array":
        return _array(head)
    rows, cols, entries = head.sizes
    # before memory is asked for: a few bytes can declare gigabytes
    if entries > len(text) or max(rows, cols) > len(text) + _EMPTY:
        raise ValueError(f"declares {rows}x{cols} with {entries} entries in {len(text)} bytes")
    return sp.csr_array(_entries(head, rows, cols, entries)).astype(np.float64)


def _head(text: str) -> _Head:
    first, _, rest = text.partition("\n")
    words = first.lower().split()
    if len(words) != 5 or words[0] != BANNER or words[1] != "matrix":
        raise ValueError("does not begin with %%MatrixMarket matrix, its layout, field and symmetry")
    _, _, layout, field, symmetry = words
    if field == "complex":
        raise ValueError("holds complex numbers, expected real ones")
    for word, known in ((layout, _LAYOUTS), (field, _FIELDS), (symmetry, _SYMMETRIES)):
        if word not in known or (layout == "array" and word == "pattern"):
            raise ValueError(f"has '{word[:40]}' in its first line, expected {', '.join(known)}")
    line = ""
    while rest and (not line or line.startswith("%")):
        line, _, rest = rest.partition("\n")
        line = line.strip()
    sizes = tuple(_whole(line.split()))
    if len(sizes) != (2 if layout == "array" else 3) or min(sizes) < 0:
        raise ValueError(f"has the sizes '{line[:40]}', expected {'rows columns' + ' entries' * (layout != 'array')}")
    if symmetry != "general" and sizes[0] != sizes[1]:
        raise ValueError(f"is {sizes[0]}x{sizes[1]} and {symmetry}")
    return _Head(layout, field, symmetry, sizes, rest)


def _array(head: _Head) -> NDArray[Any]:
    rows, cols = head.sizes
    numbers, skew = _numbers(head.body.split()), head.symmetry == "skew-symmetric"
    general = head.symmetry == "general"
    expected = rows * cols if general else rows * (rows - 1) // 2 + (0 if skew else rows)
    if numbers.size != expected:
        raise ValueError(f"has {numbers.size} numbers, expected {expected} of a {head.symmetry} array of {rows}x{cols}")
    if general:
        return numbers.reshape((rows, cols), order="F")
    column, row = np.triu_indices(rows, int(skew))
    result = np.zeros((rows, cols))
    result[column, row] = -numbers if skew else numbers
    result[row, column] = numbers
    return result


def _entries(head: _Head, rows: int, cols: int, entries: int) -> sp.coo_array:
    row, column, values = _columns(head, entries)
    for index, size in ((row, rows), (column, cols)):
        if entries and (index.min() < 0 or index.max() >= size):
            wrong = index[(index < 0) | (index >= size)][0]
            raise ValueError(f"has the index {wrong + 1} in a matrix of {rows}x{cols}")
    if head.symmetry != "general":
        off = row != column
        mirrored = -values[off] if head.symmetry == "skew-symmetric" else values[off]
        row, column = np.concatenate((row, column[off])), np.concatenate((column, row[off]))
        values = np.concatenate((values, mirrored))
    return sp.coo_array((values, (row, column)), shape=(rows, cols))


def _columns(head: _Head, entries: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Return rows and columns, from 0, and values of all entries; raises ValueError."""
    kinds: list[tuple[str, type]] = [("row", np.int64), ("column", np.int64)]
    kinds += [] if head.field == "pattern" else [("value", np.float64)]
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # 1.5 as an index
        warnings.simplefilter("ignore", UserWarning)  # no entries
        try:
            table = np.loadtxt(io.StringIO(head.body), dtype=kinds, comments=None, ndmin=1)
        except DeprecationWarning as cause:
            raise ValueError(f"has an index that is no whole number ({cause})") from None
    if table.size != entries:
        raise ValueError(f"has {table.size} lines, expected {entries} entries")
    values = np.ones(entries) if head.field == "pattern" else table["value"].copy()
    return table["row"] - 1, table["column"] - 1, values


def _numbers(words: Sequence[str]) -> NDArray[np.float64]:
    return np.fromiter(map(float, _plain(words)), np.float64, len(words))


def _whole(words: Sequence[str]) -> NDArray[np.int64]:
    try:
        return np.fromiter(map(int, _plain(words)), np.int64, len(words))
    except OverflowError as cause:
        raise ValueError(f"has too large a whole number ({cause})") from None


def _plain(words: Sequence[str]) -> Sequence[str]:
    """Return the words; raises ValueError for Python's 1_000, which no other reader takes."""
    if any("_" in word for word in words):
        raise ValueError("has a number with '_' in it")
    return words
