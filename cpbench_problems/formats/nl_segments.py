"""Segments of an .nl file, in any order.

A row is its expression (C, or O of the objective) plus its linear terms (J, G); r has its sides or the variable that it
is complementary to, b the bounds of variables, x starts, V variables that are defined by expressions. Passed over are
d (starts of multipliers), S (suffixes) but those of special ordered sets, and rows without a side. Every segment is
required whose sizes are not 0; the number of linear terms has to be what the header and k (by columns) say.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from cpbench.errors import FormatError
from cpbench.formulations.expressions.operators import Operator
from cpbench_problems.formats.mof_functions import Affine, Functions
from cpbench_problems.formats.nl_expressions import NLExpressions
from cpbench_problems.formats.nl_header import read_header

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
