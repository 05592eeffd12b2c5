"""Siconos text, the lower half: a cursor over blank-separated tokens, and the matrix block of NumericsMatrix.

    storage (0 dense, 1 blocks, 2 sparse), rows, columns, then
    dense    rows, columns again, the numbers column by column (lines break after `columns` numbers: they mislead)
    blocks   count, block rows, block columns, cumulative row ends, column ends, then the block pattern by rows
             (two lengths, row pointers, block columns), then for each block its number and its numbers by columns
    sparse   origin (1 triplet, 2 columns, 3 rows, 4 half a symmetric triplet), CSparse's own print of the matrix

Siconos prints sparse values with 6 digits: such a matrix is not the one that was solved, and a warning says so.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.errors import FormatError
from cpbench.foundation.matrices import Matrix, Sparse, Vector
from cpbench.storage.base import read_text

logger = logging.getLogger("cpbench.storage")
SIGNED = "cpbench"
"""The last line of our files: this and the name of the format."""
_SIZE = re.compile(r"(\d{1,18})-by-(\d{1,18}),?")
_warned: set[Path] = set()


class Cursor:
    """Tokens of a text file and a place among them; every refusal is a FormatError that names the field.

    `guess` says that the layout is tried, not known.
    """

    def __init__(self, path: Path, tokens: list[str] | None = None, *, guess: bool = False) -> None:
        self.path, self.at, self.guess = path, 0, guess
        self.tokens = read_text(path).split() if tokens is None else tokens
        self.known: dict[int, tuple[Matrix, int]] = {}

    def again(self) -> Cursor:
        """Return a cursor at the beginning of the same file; matrices that were read are remembered by their place."""
        other = Cursor(self.path, self.tokens, guess=self.guess)
        other.known = self.known
        return other

    @property
    def signature(self) -> str:
        """The format that a file of ours names in its last line, "" in one of others."""
        return self.tokens[-1] if self.tokens[-2:-1] == [SIGNED] else ""

    @property
    def left(self) -> int:
        return len(self.tokens) - self.at

    def error(self, field: str, cause: str) -> FormatError:
        return FormatError(self.path, field, cause)

    def word(self, field: str) -> str:
        if not self.left:
            raise self.error(field, "is missing: the file ends before it")
        self.at += 1
        return self.tokens[self.at - 1]

    def integer(self, field: str) -> int:
        """Read a count: digits only."""
        token = self.word(field)
        if not _is_count(token):
            raise self.error(field, f"is '{token[:24]}', expected a whole number")
        return int(token)

    def integers(self, field: str, count: int) -> NDArray[np.int64]:
        self._require(field, count)
        return np.array([self.integer(field) for _ in range(count)], dtype=np.int64)

    def numbers(self, field: str, count: int) -> Vector:
        """Read `count` numbers at once; raises FormatError before allocating when the file has fewer."""
        self._require(field, count)
        taken = self.tokens[self.at : self.at + count]
        self.at += count
        return self._floats(field, taken)

    def strided(self, field: str, count: int, width: int) -> list[list[str]]:
        """Read the columns of `count` rows of `width` tokens."""
        self._require(field, count * width)
        taken = self.tokens[self.at : self.at + count * width]
        self.at += count * width
        return [taken[k::width] for k in range(width)]

    def _require(self, field: str, count: int) -> None:
        if count > self.left:
            raise self.error(field, f"has {self.left} numbers left in the file, expected {count}")

    def _floats(self, field: str, tokens: list[str]) -> Vector:
        try:
            return np.fromiter(map(float, tokens), np.float64, len(tokens))
        except ValueError as cause:
            raise self.error(field, f"holds something that is not a number ({cause})") from None

    def finish(self, *, flag: bool = False, answers: tuple[int, ...] = ()) -> None:
        """Refuse numbers after the last one of a layout.

        Allowed are: nothing; text, from the first token that is not a number to the end; with `flag`, a lone 0 or 1
        in one digit (old Siconos writers: 'a guess follows'; coefficients are always printed with an exponent);
        a recorded answer of as many numbers as `answers` lists.
        """
        extra, most = 0, max(answers, default=1)  # beyond these it is too many, whatever their number
        while extra <= most and self.at + extra < len(self.tokens) and is_number(self.tokens[self.at + extra]):
            extra += 1
        if extra > most:
            raise self.error("end", f"has more than {most} numbers after the last one of this layout, expected none")
        if extra and not (flag and extra == 1 and self.tokens[self.at] in ("0", "1")) and extra not in answers:
            raise self.error("end", f"has {extra} more numbers after the last one of this layout, expected none")


def _is_count(token: str) -> bool:
    """Return whether a token is a whole number, of so few digits that Python converts it."""
    return token.isdecimal() and len(token) <= 18


def is_number(token: str) -> bool:
    try:
        float(token)
    except ValueError:
        return False
    return True


def read_matrix(c: Cursor, name: str, shape: tuple[int, int] | None) -> Matrix:
    """Read the matrix block at the cursor; `shape` None: any square one."""
    storage, rows, cols = (c.integer(f"{name}/{part}") for part in ("storage", "rows", "columns"))
    if shape is not None and (rows, cols) != shape:
        odd = ", rectangular problems are not known here" if shape[0] == shape[1] and rows != cols else ""
        raise c.error(name, f"is {rows}x{cols}, expected {shape[0]}x{shape[1]}{odd}")
    if shape is None and rows != cols:
        raise c.error(name, f"is {rows}x{cols}, expected a square matrix")
    if max(rows, cols) > c.left:  # vectors of these sizes follow in every layout
        raise c.error(name, f"is {rows}x{cols}, with {c.left} numbers left in the file")
    start = c.at
    if start not in c.known:
        c.known[start] = _numbers(c, name, storage, rows, cols), c.at
    M, c.at = c.known[start]
    return M


def _numbers(c: Cursor, name: str, storage: int, rows: int, cols: int) -> Matrix:
    if storage == 0:
        if (c.integer(f"{name}/rows"), c.integer(f"{name}/columns")) != (rows, cols):
            raise c.error(name, f"repeats its size {rows}x{cols} as another one")
        return c.numbers(name, rows * cols).reshape((rows, cols), order="F")
    if storage == 1:
        return _blocks(c, name, rows, cols)
    if storage == 2:
        return _sparse(c, name, rows, cols)
    raise c.error(f"{name}/storage", f"is {storage}, expected 0 (dense), 1 (blocks) or 2 (sparse)")


def _blocks(c: Cursor, name: str, rows: int, cols: int) -> Sparse:
    count = c.integer(f"{name}/blocks")
    if count == 0:
        return sp.csr_array((rows, cols), dtype=np.float64)
    block_rows, block_cols = c.integer(f"{name}/block rows"), c.integer(f"{name}/block columns")
    row_ends, col_ends = c.integers(f"{name}/row ends", block_rows), c.integers(f"{name}/column ends", block_cols)
    for ends, size, what in ((row_ends, rows, "row"), (col_ends, cols, "column")):
        if not ends.size or ends[-1] != size or (np.diff(ends) < 0).any():
            raise c.error(f"{name}/{what} ends", f"do not rise to {size}")
    filled_rows, filled = c.integer(f"{name}/filled1"), c.integer(f"{name}/filled2")
    pointers, columns = c.integers(f"{name}/index1", filled_rows), c.integers(f"{name}/index2", filled)
    if not 1 <= filled_rows <= block_rows + 1 or pointers[0] != 0 or (np.diff(pointers) < 0).any():
        raise c.error(f"{name}/index1", f"is not a list of at most {block_rows + 1} rising pointers from 0")
    if pointers[-1] != count or filled < count or (columns[:count] >= block_cols).any():
        raise c.error(f"{name}/index2", f"does not place {count} blocks in {block_rows}x{block_cols}")
    block_row = np.repeat(np.arange(filled_rows - 1), np.diff(pointers))
    block_col = columns[:count]
    row_start, col_start = row_ends - np.diff(row_ends, prepend=0), col_ends - np.diff(col_ends, prepend=0)
    heights, widths = (row_ends - row_start)[block_row], (col_ends - col_start)[block_col]
    sizes = heights * widths
    numbers = c.numbers(f"{name}/values", int(sizes.sum()) + count)
    labels = np.cumsum(sizes + 1) - sizes - 1
    if (numbers[labels] != np.arange(count)).any():
        raise c.error(f"{name}/values", f"do not number the {count} blocks from 0 upwards")
    inside = np.arange(int(sizes.sum())) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    row = np.repeat(row_start[block_row], sizes) + inside % np.repeat(heights, sizes)
    col = np.repeat(col_start[block_col], sizes) + inside // np.repeat(heights, sizes)
    return sp.csr_array(sp.coo_array((np.delete(numbers, labels), (row, col)), shape=(rows, cols)))


def _sparse(c: Cursor, name: str, rows: int, cols: int) -> Sparse:
    origin = c.integer(f"{name}/origin")
    start = c.at
    while c.left and c.at - start < 40 and not _SIZE.fullmatch(c.tokens[c.at]):
        c.at += 1
    layout = c.tokens[c.at - 1] if c.at > start else ""
    size = _SIZE.fullmatch(c.word(name)) if c.left else None
    if size is None or c.tokens[start] != "CSparse":
        raise c.error(name, "is not followed by the heading of CSparse")
    if (int(size[1]), int(size[2])) != (rows, cols):
        raise c.error(name, f"is {size[1]}x{size[2]} for CSparse, {rows}x{cols} before")
    for _ in ("nzmax:", "<number>", "nnz:"):
        c.word(name)
    token = c.word(f"{name}/nnz").rstrip(",")
    if not _is_count(token):
        raise c.error(f"{name}/nnz", f"is '{token[:24]}', expected a whole number")
    if c.left and c.tokens[c.at] == "1-norm:":
        c.at += 2
    count = int(token)
    if layout == "triplet:":
        i, j, colons, values = c.strided(f"{name}/triplet", count, 4)
    else:
        i, j, colons, values = _compressed(c, name, count, rows if layout == "csr:" else cols)
        i, j = (j, i) if layout == "csr:" else (i, j)
    if any(colon != ":" for colon in colons):
        raise c.error(name, "does not have a ':' before every value")
    _warn_of_six_digits(c.path, values)
    row, col = (_indices(c, name, index, n) for index, n in ((i, rows), (j, cols)))
    M = sp.csr_array(sp.coo_array((c._floats(name, values), (row, col)), shape=(rows, cols)))
    if origin != 4:
        return M
    if sp.triu(M, 1).nnz and sp.tril(M, -1).nnz:
        raise c.error(name, "is half of a symmetric matrix (origin 4) but has entries on both sides of the diagonal")
    return sp.csr_array(M + M.T - sp.diags_array(M.diagonal()))


def _compressed(c: Cursor, name: str, count: int, majors: int) -> tuple[list[str], list[str], list[str], list[str]]:
    """Read minor index, major index, colon, value of every entry of `col j : locations a to b`, then `row : value`
    lines.
    """
    minor: list[str] = []
    major: list[str] = []
    colons: list[str] = []
    values: list[str] = []
    for k in range(majors if count or (c.left and c.tokens[c.at] in ("col", "row")) else 0):
        head = [part[0] for part in c.strided(f"{name}/column {k}", 1, 7)]
        first, last = head[4], head[6]
        counts = _is_count(first) and _is_count(last.removeprefix("-"))
        if head[0] not in ("col", "row") or head[1] != str(k) or not counts:
            raise c.error(
                f"{name}/column {k}", f"begins with '{' '.join(head)}', expected 'col {k} : locations a to b'"
            )
        entries = int(last) - int(first) + 1
        if int(first) != len(values) or entries < 0:
            raise c.error(f"{name}/column {k}", f"has locations {first} to {last}, expected them from {len(values)} on")
        rows, marks, numbers = c.strided(f"{name}/column {k}", entries, 3)
        minor += rows
        major += [str(k)] * entries
        colons += marks
        values += numbers
    if len(values) != count:
        raise c.error(name, f"has {len(values)} entries, expected nnz = {count}")
    return minor, major, colons, values


def _indices(c: Cursor, name: str, tokens: list[str], limit: int) -> NDArray[Any]:
    try:
        index = np.fromiter(map(int, tokens), np.int64, len(tokens))
    except (ValueError, OverflowError) as cause:
        raise c.error(name, f"has an index that is no whole number ({cause})") from None
    if index.size and (index.min() < 0 or index.max() >= limit):
        raise c.error(name, f"holds the index {int(index.max())}, expected 0 to {limit - 1}")
    return index


def _warn_of_six_digits(path: Path, values: Iterable[str]) -> None:
    """Warn once a file when some value has exactly 6 digits and none has more: digits were cut."""
    digits = {len(v.lstrip("-0.").partition("e")[0].replace(".", "")) for v in values}
    if max(digits, default=0) == 6 and path not in _warned:
        _warned.add(path)
        logger.warning("%s: sparse matrices in this text file have 6 digits: the problem is a rounded one", path)
