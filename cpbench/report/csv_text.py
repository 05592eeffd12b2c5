"""Rows of results as CSV, byte for byte what pandas writes, in a third of the time.

Text of others is data in every program that opens the file: cells that a spreadsheet would take for a formula begin
with an apostrophe, and control characters are spelled out.

Of the 55 cells of a row some 15 differ from those of the rows around it: what repeats is spelled once. Numbers keep
every digit.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, BinaryIO, TypeAlias

import numpy as np
import pandas as pd

from cpbench.plain_text import printable

Values: TypeAlias = np.ndarray[tuple[int], np.dtype[Any]]
Spell: TypeAlias = Callable[[Values], list[str]]

LINES = 5_000
"""Lines that are held at a time."""
REMEMBERED = 10_000
"""Cells of a column that are kept to be spelled once."""
STRETCH = 100
"""Rows side by side, in ten places, that are looked at for what repeats."""
FEW = 0.2
"""Different cells among these, as a share, up to which a column repeats."""
_SPECIAL = re.compile(r'[,"\r\n]')
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
_UNSAFE = re.compile(
    "(?:^|\0)[=+\\-@\t\r]|[\x01-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
)
"""What joined cells have where one of them may be obeyed."""


class _Spelled(dict[Any, str]):
    """Cells by value, or by the bits of a number (-0 equals 0), made when they are asked for."""

    def __init__(self, of_bits: bool) -> None:
        super().__init__()
        self._of_bits = of_bits

    def __missing__(self, value: Any) -> str:
        if len(self) >= REMEMBERED:
            self.clear()
        self[value] = cell = _cell(np.int64(value).view(np.float64).item() if self._of_bits else value)
        return cell


def write(rows: pd.DataFrame, file: BinaryIO) -> None:
    """Write a table without its index: names of the columns, then a line a row; nothing for what is missing."""
    if not all(_plain(values) for _, values in rows.items()):
        texts = rows.select_dtypes(["object", "str"]).columns
        safe = {name: rows[name].map(lambda cell: harmless(cell) if isinstance(cell, str) else cell) for name in texts}
        rows.assign(**safe).to_csv(file, index=False, lineterminator="\n")
        return
    file.write((",".join(_cell(str(name)) for name in rows) + "\n").encode())
    columns = [np.asarray(values, dtype=object if values.dtype == "str" else None) for _, values in rows.items()]
    spell = [_spelling(values) for values in columns]
    for start in range(0, len(rows), LINES):
        cells = [own(values[start : start + LINES]) for own, values in zip(spell, columns, strict=True)]
        file.write(("\n".join(map(",".join, zip(*cells, strict=True))) + "\n").encode())


def _plain(values: pd.Series) -> bool:
    """Whether a column is of text, numbers or truth values."""
    if values.dtype == object:
        return pd.api.types.infer_dtype(values, skipna=True) in ("string", "empty")
    return str(values.dtype) in ("str", "float64", "int64", "bool")


def _spelling(values: Values) -> Spell:
    """How the cells of a column are made: each by itself where few are like another."""
    starts = range(0, len(values), max(STRETCH, len(values) // 10))
    some = np.concatenate([values[:0], *(values[k : k + STRETCH] for k in starts)])
    repeats = len(set(map(_cell, some.tolist()))) <= len(some) * FEW
    if values.dtype == np.float64:
        known = _Spelled(of_bits=True)
        return (lambda part: list(map(known.__getitem__, part.view(np.int64).tolist()))) if repeats else _numbers
    known = _Spelled(of_bits=False)
    if values.dtype == object and not repeats:
        return _texts
    return lambda part: list(map(known.__getitem__ if repeats else _cell, part.tolist()))


def _numbers(values: Values) -> list[str]:
    cells = list(map(repr, values.tolist()))
    for k in np.flatnonzero(np.isnan(values)).tolist():
        cells[k] = ""
    return cells


def _texts(values: Values) -> list[str]:
    """Cells of text of which no two may be alike: quotes are doubled in all of them at once."""
    cells = values.tolist()
    try:
        joined = "\0".join(cells)
    except TypeError:  # some are missing
        return list(map(_cell, cells))
    if _UNSAFE.search(joined) or joined.count("\0") >= len(cells):
        return list(map(_cell, cells))
    if not _SPECIAL.search(joined):
        return cells
    parts = joined.replace('"', '""').split("\0")
    if len(parts) != len(cells):  # some have that character
        return list(map(_cell, cells))
    return [f'"{t}"' if "," in t or '"' in t or "\n" in t or "\r" in t else t for t in parts]


def harmless(text: str) -> str:
    """Text that no spreadsheet computes and no terminal obeys.

    >>> harmless("=1+1"), harmless("a-b")
    ("'=1+1", 'a-b')
    """
    text = "\r".join(map(printable, text.split("\r")))  # the end of a line, in quotes
    return f"'{text}" if text.startswith(_FORMULA) else text


def _cell(value: Any) -> str:
    if isinstance(value, str):
        value = harmless(value)
        return '"' + value.replace('"', '""') + '"' if _SPECIAL.search(value) else value
    return "" if value is None or value != value else repr(value)
