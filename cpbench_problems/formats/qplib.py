"""Continuous quadratic programs in QPLIB's text (Furini et al. 2019, Math. Prog. Comp. 11, appendix B; GALAHAD's RPD).

One value a line, in a fixed order, further words of a line are comments: name, type, sense, numbers of variables and of
rows, entries of the Hessian (each pair once), then a default, a count and `index value` of each vector: the linear
term, sides, bounds, starting values. The type has three letters: objective L, D, C or Q; variables C, where all are
continuous; rows N or B where there are none, L where they are linear.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import FormatError
from cpbench.formulations import QP
from cpbench.formulations.base import Info, Problem
from cpbench.foundation.matrices import Vector
from cpbench.foundation.text import printable
from cpbench.storage.base import OFFSET, SENSE, Format, build, formats, no_member, read_text
from cpbench_problems.formats import two_sided
from cpbench_problems.formats.named_arrays import symmetrized

_LARGEST = 10**7


class QPLib(Format):
    """A quadratic program with linear rows."""

    name = "qplib"
    summary = "continuous quadratic program with linear rows in QPLIB's text"
    suffixes = (".qplib",)

    def recognises(self, path: Path, head: bytes) -> bool:
        return path.suffix.lower() == ".qplib"

    def load(self, path: Path, member: str) -> Problem:
        no_member(path, member)
        lines = _Lines(path)
        name, kind, sense = (lines.words("a word", 1)[0] for _ in range(3))
        if len(kind) != 3 or kind[0] not in "LDCQ" or kind[1] not in "CBMIG" or kind[2] not in "NBLDCQ":
            raise FormatError(path, "type", f"is {printable(kind[:20])}, expected three letters, as QCL")
        if kind[1] != "C":
            raise FormatError(path, "type", f"is {kind}: integer and binary unknowns have no formulation")
        if kind[2] in "DCQ":
            raise FormatError(path, "type", f"is {kind}: quadratic rows are no part of a quadratic program")
        n = lines.count("variables", 1)
        m = lines.count("rows", 0) if kind[2] == "L" else 0
        H = lines.matrix("Hessian", n, n) if kind[0] != "L" else sp.csr_array((n, n))
        p, offset = lines.vector("linear term", n), lines.number("constant")
        A = lines.matrix("matrix", m, n) if kind[2] == "L" else sp.csr_array((0, n))
        infinity = lines.number("infinity")
        rows = [lines.vector(f"{side} sides", m, infinity) if m else np.zeros(0) for side in ("lower", "upper")]
        lb, ub = (lines.vector(f"{side} bounds", n, infinity) for side in ("lower", "upper"))
        two_sided.require_sides(path, rows[0], rows[1], "the rows")
        two_sided.require_sides(path, lb, ub, "the bounds")
        sign = -1.0 if sense.lower().startswith("max") else 1.0
        properties = ({OFFSET: sign * offset} if offset else {}) | ({SENSE: "max"} if sign < 0 else {})
        parts = two_sided.uncrossed({"lb": lb, "ub": ub, **two_sided.rows(A, rows[0], rows[1])})
        info = Info(properties=properties)
        return build(path, QP, "", name=name, info=info, Q=sign * symmetrized(H, "upper"), p=sign * p, **parts)


class _Lines:
    """The lines of a file that are no comments, taken one after the other."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lines: Iterator[tuple[int, str]] = enumerate(read_text(path).splitlines(), 1)

    def words(self, what: str, least: int) -> list[str]:
        """Return the words of the next line; raises FormatError where there are too few."""
        for number, line in self._lines:
            if (words := line.split()) and words[0][0] not in "!%#":
                if len(words) < least:
                    raise FormatError(self._path, f"line {number}", f"has {len(words)} words, expected {what}")
                return words
        raise FormatError(self._path, "", f"ends before {what}")

    def number(self, what: str) -> float:
        """Return the number of the next line."""
        word = self.words(what, 1)[0]
        try:
            return float(word)
        except ValueError:
            raise FormatError(self._path, what, f"is {printable(word[:40])}, expected a number") from None

    def count(self, what: str, least: int = 0) -> int:
        """Return the whole number of the next line."""
        number = self.number(f"number of {what}")
        if number != int(number) or not least <= number <= _LARGEST:
            raise FormatError(self._path, f"number of {what}", f"is {number:g}")
        return int(number)

    def entries(self, what: str, sizes: tuple[int, ...]) -> tuple[Any, Vector]:
        """Return the indices from 0, shape (count, d), and the values of a count and as many lines."""
        count, d = self.count(f"entries of the {what}"), len(sizes)
        table = np.zeros((count, d + 1))
        for row in table:
            words = self.words(f"an entry of the {what}", d + 1)[: d + 1]
            try:
                row[:] = [float(word) for word in words]
            except ValueError:
                raise FormatError(self._path, what, f"has {printable(' '.join(words)[:60])}") from None
        index = table[:, :d].astype(np.int64) - 1
        if (index != table[:, :d] - 1).any() or (index < 0).any() or (index >= np.array(sizes)).any():
            raise FormatError(self._path, what, f"has an index outside of 1 to {' x '.join(map(str, sizes))}")
        return index, table[:, d]

    def matrix(self, what: str, m: int, n: int) -> sp.csr_array:
        """Return the sparse matrix of the next lines."""
        index, values = self.entries(what, (m, n))
        if what == "Hessian":  # an entry of either triangle stands for both
            index = np.sort(index, axis=1)
        return sp.csr_array(sp.coo_array((values, (index[:, 0], index[:, 1])), shape=(m, n)))

    def vector(self, what: str, n: int, infinity: float = np.inf) -> Vector:
        """Return a vector of which the default stands first, then the entries that are others."""
        result = np.full(n, self.number(f"default of the {what}"))
        index, values = self.entries(what, (n,))
        result[index[:, 0]] = values
        return np.where(np.abs(result) >= infinity, np.copysign(np.inf, result), result)


formats.add("qplib", QPLib())
