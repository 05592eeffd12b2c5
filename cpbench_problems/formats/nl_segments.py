"""The header of an .nl file, ten lines of text, and its segments, in any order.

A row is its expression (C, or O of the objective) plus its linear terms (J, G); r has its sides or the variable that it
is complementary to, b the bounds of variables, x starts, V variables that are defined by expressions. Passed over are
d (starts of multipliers), S (suffixes) but those of special ordered sets, and rows without a side. Every segment is
required whose sizes are not 0; the number of linear terms has to be what the header and k (by columns) say.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cpbench.errors import FormatError
from cpbench.formulations.expressions.operators import Operator
from cpbench_problems.formats.mof_functions import Affine, Functions
from cpbench_problems.formats.nl_operators import NLExpressions
from cpbench_problems.formats.nl_source import HEADER_LINES, BinarySource, NLSource, TextSource

_LEAST = (1, 3, 2, 2, 3, 2, 5, 2, 2, 5)
"""How many numbers each line has at least."""
_OPTIONAL = 4
"""How many further ones a line may have."""
_NAMED = re.compile(r"#\s*problem[ \t]+(.*)")


@dataclass(frozen=True)
class Header:
    """Sizes of a model, and the text behind `# problem` in its first line, "" without one."""

    variables: int
    constraints: int
    objectives: int
    pairs: int
    jacobian: int
    gradients: int
    remark: str


def read_header(path: Path, data: bytes) -> tuple[Header, NLSource]:
    """Return the header and what follows it; raises FormatError."""
    lines, at = _lines(path, data)
    numbers = [_numbers(path, k, line) for k, line in enumerate(lines)]
    sizes, kinds, functions = numbers[1], numbers[2], numbers[5]
    header = Header(
        variables=sizes[0],
        constraints=sizes[1],
        objectives=sizes[2],
        pairs=sum(kinds[2:4]),
        jacobian=numbers[7][0],
        gradients=numbers[7][1],
        remark=name[1].strip() if (name := _NAMED.search(lines[0])) else "",
    )
    _check(path, header, len(data), numbers)
    if data[:1] == b"g":
        if not data.endswith(b"\n"):  # what is left of its last number may be another number
            raise FormatError(path, "", "ends in the middle of a line: the file is not complete")
        return header, TextSource(path, data, at)
    arithmetic = functions[2] if len(functions) > 2 else 0
    if arithmetic > 2:
        raise FormatError(path, "line 6", f"has the arithmetic {arithmetic}, cpbench reads 1 and 2, those of IEEE 754")
    return header, BinarySource(path, data, at, ">" if arithmetic == 2 else "<")


def _lines(path: Path, data: bytes) -> tuple[list[str], int]:
    if data[:1] not in (b"g", b"b"):
        raise FormatError(path, "line 1", "begins with neither g (text) nor b (binary), as an .nl file does")
    lines, at = list[str](), 0
    for number in range(1, HEADER_LINES + 1):
        end = data.find(b"\n", at)
        if end < 0 or end - at > 1000:
            raise FormatError(path, f"line {number}", f"does not end: an .nl file has {HEADER_LINES} lines of sizes")
        lines.append(data[at:end].decode("latin-1"))
        at = end + 1
    return lines, at


def _numbers(path: Path, line: int, text: str) -> list[int]:
    words = text[line == 0 :].partition("#")[0].split()  # behind the letter of the first line
    if line == 0:
        words = words[:1]  # the others say how a program of AMPL answers
    if len(words) < _LEAST[line] or not all(re.fullmatch(r"\d{1,10}", word, re.ASCII) for word in words):
        raise FormatError(path, f"line {line + 1}", f"has '{text[:40]}', expected {_LEAST[line]} whole numbers")
    if len(words) > _LEAST[line] + _OPTIONAL:
        raise FormatError(path, f"line {line + 1}", f"has {len(words)} numbers, expected {_LEAST[line]}")
    return [int(word) for word in words]


def _check(path: Path, header: Header, size: int, numbers: list[list[int]]) -> None:
    """Raise FormatError on what cpbench does not read, and on sizes that the file has no room for."""
    functions, logical = numbers[5][1], numbers[1][5] if len(numbers[1]) > 5 else 0
    discrete = sum(numbers[6])
    for line, count, what in (
        (2, logical, "logical constraints"),
        (6, functions, "imported functions, and cpbench runs none"),
        (7, discrete, "binary and integer variables, and cpbench has continuous ones only"),
        (2, max(header.objectives - 1, 0), "objectives more than one"),
    ):
        if count:
            raise FormatError(path, f"line {line}", f"has {count} {what}")
    for line, count, what in (
        (2, header.variables, "variables"),
        (2, header.constraints, "constraints"),
        (8, header.jacobian, "entries of the Jacobian"),
        (8, header.gradients, "entries of gradients"),
    ):
        if count > size:  # each has a byte at least
            raise FormatError(path, f"line {line}", f"declares {count} {what} in a file of {size} bytes")


LinearTerms = list[tuple[int, float]]
"""Linear terms: (number of the variable, coefficient)."""
_REAL = 4
"""The bit in the kind of a suffix that says that its values are not whole numbers."""
_SETS = ("sosno", "ref", "sos", "sosref")


def read_segments(path: Path, data: bytes) -> Segments:
    """Return the segments in the contents of a file; raises FormatError."""
    segments = Segments(path, data)
    segments.read()
    return segments


class Segments:
    """The segments of a file as they are read: by number of the row or variable.

    Attributes
    ----------
    header : sizes. functions : what all values belong to. rows, linear : value of the expression and linear terms of
    each row. objective, gradient : sense and value, linear terms. sides : of rows. beside : variable -> (row, flags)
    of complementarity conditions. bounds, start : of variables.
    """

    def __init__(self, path: Path, data: bytes) -> None:
        self._path = path
        self.header, self._source = read_header(path, data)
        n, m = self.header.variables, self.header.constraints
        self.functions = Functions(path, {f"v{k}": k for k in range(n)})
        self._defined: dict[int, int] = {}
        self._expressions = NLExpressions(self._source, self.functions.build, self._defined)
        self.rows: dict[int, int] = {}
        self.linear: dict[int, LinearTerms] = {}
        self.objective: tuple[str, int] | None = None
        self.gradient: LinearTerms = []
        self.sides: list[tuple[float, float]] = []
        self.beside: dict[int, tuple[int, int]] = {}
        self.bounds: list[tuple[float, float]] = []
        self.start = np.zeros(n)
        self._columns: list[int] | None = None
        self._seen: set[str] = set()
        self._m = m

    def read(self) -> None:
        """Read all segments; raises FormatError."""
        source = self._source
        segments = {
            "C": self._constraint, "O": self._read_objective, "V": self._variable, "J": self._jacobian,
            "G": self._read_gradient, "r": self._read_sides, "b": self._read_bounds, "k": self._lengths,
            "x": self._starts, "d": self._multipliers, "S": self._suffix,
        }  # fmt: skip
        while key := source.key():
            if key not in segments:
                source.refuse(f"has a segment {key!a}, cpbench reads {', '.join(segments)}")
            if key in "rbkxd":
                if key in self._seen:
                    source.refuse(f"has a second segment {key}")
                self._seen.add(key)
            segments[key]()
        self._complete()

    def _complete(self) -> None:
        """Raise FormatError where a segment is missing, or sizes are not those of the header."""
        header, n = self.header, self.header.variables
        missing = [f"C{k}" for k in range(self._m) if k not in self.rows][:1]
        missing += ["r"] * bool(self._m and "r" not in self._seen) + ["b"] * bool(n and "b" not in self._seen)
        missing += ["O0"] * bool(header.objectives and self.objective is None)
        if missing:
            raise FormatError(self._path, "", f"has no segment {missing[0]}: the file is not complete")
        entries = sum(map(len, self.linear.values()))
        for count, declared, what in (
            (entries, header.jacobian, "linear terms of constraints (J)"),
            (len(self.gradient), header.gradients, "linear terms of the objective (G)"),
            (len(self.beside), header.pairs, "complementarity conditions"),
        ):
            if count != declared:
                raise FormatError(self._path, "", f"has {count} {what}, its header says {declared}")
        if self._columns is not None:
            counts = np.bincount([j for terms in self.linear.values() for j, _ in terms], minlength=n)
            if np.cumsum(counts)[: n - 1].tolist() != self._columns:
                raise FormatError(self._path, "", "has other lengths of columns in k than its terms in J have")

    # ------------------------------------------------------------------------------------- segments

    def _constraint(self) -> None:
        row = self._source.below(self._m, "constraint")
        self._source.end()
        if row in self.rows:
            self._source.refuse(f"has a second segment C{row}")
        self.rows[row] = self._expressions.read()

    def _read_objective(self) -> None:
        source = self._source
        source.below(self.header.objectives, "objective")
        sense = source.below(2, "sense (0 minimizes, 1 maximizes)")
        source.end()
        if self.objective is not None:
            source.refuse("has a second segment O")
        self.objective = ("max" if sense else "min", self._expressions.read())

    def _variable(self) -> None:
        source = self._source
        number, count = source.whole(), source.whole()
        source.whole()  # which rows use it
        source.end()
        if number < self.header.variables or number in self._defined:
            source.refuse(f"defines v{number}, which is a variable already")
        linear = self._read_terms(count)
        value = self._expressions.read()
        self._defined[number] = self.sum(value, [term for term in linear if term[1]])

    def _jacobian(self) -> None:
        source = self._source
        row, count = source.below(self._m, "constraint"), source.whole()
        source.end()
        if row in self.linear:
            source.refuse(f"has a second segment J{row}")
        self.linear[row] = self._read_terms(count)

    def _read_gradient(self) -> None:
        source = self._source
        source.below(self.header.objectives, "objective")
        count = source.whole()
        source.end()
        if self.gradient:
            source.refuse("has a second segment G")
        self.gradient = self._read_terms(count)

    def _read_terms(self, count: int) -> LinearTerms:
        source, n = self._source, self.header.variables
        result: LinearTerms = []
        for _ in range(count):
            source.line()
            result.append((source.below(n, "variable"), source.finite()))
            source.end()
        if len({column for column, _ in result}) < count:
            source.refuse("has a variable twice in the linear terms of a row")
        return result

    def _read_sides(self) -> None:
        self._source.end()
        self.sides = [self._interval(row) for row in range(self._m)]

    def _read_bounds(self) -> None:
        self._source.end()
        self.bounds = [self._interval(None) for _ in range(self.header.variables)]

    def _interval(self, row: int | None) -> tuple[float, float]:
        """Read the sides of a row, or the bounds of a variable (None)."""
        source = self._source
        kind = source.key()
        low, high = -math.inf, math.inf
        if kind == "0":
            low, high = source.number(), source.number()
        elif kind == "1":
            high = source.number()
        elif kind == "2":
            low = source.number()
        elif kind == "4":
            low = high = source.finite()
        elif kind == "5" and row is not None:
            self._complement(row)
        elif kind != "3":
            source.refuse(f"has {kind!a}, expected the kind of an interval, 0 to {4 if row is None else 5}")
        source.end()
        if low == math.inf or high == -math.inf:
            source.refuse(f"has the interval from {low:g} to {high:g}, which no number is in")
        return low, high

    def _complement(self, row: int) -> None:
        source, n = self._source, self.header.variables
        flags, column = source.below(4, "kind of complementarity"), source.whole() - 1
        if not 0 <= column < n:
            source.refuse(f"is complementary to variable {column + 1}, expected one of 1 to {n}")
        if column in self.beside:
            source.refuse(f"is complementary to variable {column + 1}, as row {self.beside[column][0] + 1} is")
        self.beside[column] = (row, flags)

    def _lengths(self) -> None:
        source, n = self._source, self.header.variables
        if source.whole() != max(n - 1, 0):
            source.refuse(f"has another number of lengths than {max(n - 1, 0)}, one less than variables")
        source.end()
        numbers = list[int]()
        for _ in range(n - 1):
            source.line()
            numbers.append(source.whole())
            source.end()
        self._columns = numbers

    def _starts(self) -> None:
        count = self._source.whole()
        self._source.end()
        for column, value in self._read_terms(count):
            self.start[column] = value

    def _multipliers(self) -> None:
        source = self._source
        count = source.whole()
        source.end()
        for _ in range(count):
            source.line()
            source.below(self._m, "constraint")
            source.number()
            source.end()

    def _suffix(self) -> None:
        source = self._source
        kind, count, name = source.whole(), source.whole(), source.word()
        source.end()
        if name in _SETS:
            source.refuse(f"has the suffix {name} of special ordered sets, which cpbench has not")
        for _ in range(count):
            source.line()
            source.whole()
            if kind & _REAL:
                source.number()
            else:
                source.signed()
            source.end()

    def sum(self, value: int, linear: LinearTerms) -> int:
        """Return an expression plus linear terms."""
        build = self.functions.build
        if not linear:
            return value
        affine = Affine([column for column, _ in linear], [c for _, c in linear], 0.0)
        terms = self.functions.value(affine)
        return terms if build.number(value) == 0.0 else build.apply(Operator.ADD, value, terms)
