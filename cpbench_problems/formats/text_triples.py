"""An LCP as lines of text: `row column value` of each entry of M, and `q row value` of each number of q.

Rows are counted from 0 or from 1, as those of q say, which has a line for each. Entries of M that have no line are 0.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TypeVar

import numpy as np
import scipy.sparse as sp

from cpbench.errors import FormatError
from cpbench.formulations.base import Problem
from cpbench.formulations.linear import LCP
from cpbench.foundation.text import printable
from cpbench.storage.base import Format, build, formats, no_member, read_text, stem
from cpbench_problems.formats.text_lcp import vector_file

Key = TypeVar("Key")

_LINE_END = re.compile(r"\r\n|\r|\n")
_WORD = re.compile(r"[^ \t\r\n\f]+")
"""Python takes more characters for ends of lines and for blanks, among them some that stand in numbers (the blank that
does not break), and would cut these."""
_VECTOR = "q"
_TAIL = 512
"""Bytes that hold the last line."""


class TextTriples(Format):
    """Row, column, value, as programs print the sparse matrix of an LCP."""

    name = "text-triples"
    summary = "LCP in one text file: lines 'row column value' of M and 'q row value'"
    suffixes = (".txt",)

    def recognises(self, path: Path, head: bytes) -> bool:
        partner = vector_file(path)
        if path.suffix.lower() not in self.suffixes or (partner is not None and partner.is_file()):
            return False
        return _is_triple(next(_lines(head.decode("latin-1")), (0, []))[1])

    def in_folder(self, path: Path, head: bytes) -> bool:
        """Return whether to list the file; two whole numbers and a third without q are more often something else."""
        if not self.recognises(path, head) or not path.is_file():
            return False
        with path.open("rb") as file:
            file.seek(max(path.stat().st_size - _TAIL, 0))
            tail = file.read()
        ends = [list(_lines(part.decode("latin-1"))) for part in (head, tail)]
        return _VECTOR in (ends[0][0][1][0], ends[1][-1][1][0] if ends[1] else "")

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        entries: dict[tuple[int, int], float] = {}
        sides: dict[int, float] = {}
        for number, words in _lines(read_text(path)):
            if not _is_triple(words):
                text = printable(" ".join(words)[:60])
                raise FormatError(path, f"line {number}", f"is '{text}', expected 'row column value' or 'q row value'")
            first, second, value = words
            if first == _VECTOR:
                _enter(path, number, sides, int(second), value)
            else:
                _enter(path, number, entries, (int(first), int(second)), value)
        rows = _rows(path, sides)
        q = np.array([sides[row] for row in rows])
        return build(path, LCP, "", name=stem(path), M=_matrix(path, entries, rows), q=q)


def _lines(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the words of each line and its number, without comments."""
    for number, line in enumerate(_LINE_END.split(text), 1):
        if words := _WORD.findall(line.split("#")[0].replace(",", " ")):
            yield number, words


def _is_triple(words: list[str]) -> bool:
    if len(words) != 3 or "_" in words[2]:  # Python's 1_000, which no other reader takes
        return False
    indices = words[1:2] if words[0] == _VECTOR else words[:2]
    if not all(word.isascii() and word.isdigit() and len(word) < 19 for word in indices):
        return False
    try:
        float(words[2])
    except ValueError:
        return False
    return True


def _enter(path: Path, number: int, numbers: dict[Key, float], key: Key, value: str) -> None:
    """Enter the number of a line; raises FormatError where a line before has one for the same place."""
    if key in numbers:
        raise FormatError(path, f"line {number}", "is the second one of this place: a sum of both may be meant")
    numbers[key] = float(value)


def _rows(path: Path, sides: Mapping[int, float]) -> range:
    """Return the numbers of the rows, from 0 or from 1; raises FormatError where q does not have each once."""
    if not sides:
        cause = "has no line 'q row value': an LCP needs them after those of M; a matrix alone goes into cpbench pack"
        raise FormatError(path, "q", cause)
    first = min(sides)
    rows = range(first, first + len(sides))
    if first > 1 or max(sides) not in rows:
        missing = first - 1 if first > 1 else next(row for row in rows if row not in sides)
        raise FormatError(path, "q", f"has no line for row {missing}: expected one for each row, from 0 or from 1")
    return rows


def _matrix(path: Path, entries: Mapping[tuple[int, int], float], rows: range) -> sp.csr_array:
    """Return M; raises FormatError where an entry has a row or column that q does not have."""
    for entry in entries:
        if entry[0] not in rows or entry[1] not in rows:
            cause = f"has an entry at row {entry[0]}, column {entry[1]}; q has rows {rows[0]} to {rows[-1]}"
            raise FormatError(path, "M", cause)
    places = np.array(list(entries), dtype=np.int64).reshape(-1, 2) - rows[0]
    values = np.array(list(entries.values()), dtype=np.float64)
    return sp.csr_array(sp.coo_array((values, (places[:, 0], places[:, 1])), shape=(len(rows), len(rows))))


formats.add("text-triples", TextTriples())
