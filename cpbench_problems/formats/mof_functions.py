"""Functions of MathOptFormat, scalar and vector: affine, quadratic and nonlinear ones, as values of one map."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from cpbench.errors import FormatError, ProblemError
from cpbench.formulations.expressions.map import Builder, Map
from cpbench.formulations.expressions.operators import Operator
from cpbench_problems.formats.mof_json import Fields, shown, shown_number
from cpbench_problems.formats.mof_operators import KNOWN, combine


@dataclass(slots=True)
class Affine:
    """Σ valueᵢ z[columnᵢ] + constant."""

    columns: list[int]
    values: list[float]
    constant: float

    def negative(self) -> Affine:
        return Affine(self.columns, [-value for value in self.values], -self.constant)

    def plus(self, other: Affine) -> Affine:
        return Affine([*self.columns, *other.columns], [*self.values, *other.values], self.constant + other.constant)


@dataclass(slots=True)
class Quadratic:
    """Σ coefficient zᵢzⱼ + affine; a pair (i, i) has half of its coefficient, as MathOptFormat means it."""

    products: list[tuple[int, int, float]]
    affine: Affine


@dataclass(slots=True)
class Nonlinear:
    """A value of the map, by its number."""

    value: int


Function: TypeAlias = Affine | Quadratic | Nonlinear


class Functions:
    """Functions of the variables `column` (name -> number), all in one map.

    `source` is what a FormatError names, with the place of the function and the entry of its node_list. `parameters`
    are further names, with their values.
    """

    def __init__(
        self, source: str | Path, column: Mapping[str, int], parameters: Mapping[str, float] | None = None
    ) -> None:
        self._fields = Fields(source)
        self._inputs = len(column)
        self.build = Builder(self._inputs)
        try:
            others = {name: self.build.parameter(name, value) for name, value in (parameters or {}).items()}
        except ProblemError as cause:
            raise FormatError(source, "variables", cause.cause) from None
        self._column = {**column, **others}
        self.parameters = dict(parameters or {})

    def take(self, F: Map) -> list[int]:
        """Return the values of the rows of a map, which becomes part of this one; a parameter that is none here is a
        number.
        """
        build, number = self.build, list(range(F.inputs))
        names = {index: name for name, index in F.named.items()}
        for index, c in enumerate(F.constants.tolist()):
            name = names.get(index, "")
            number.append(self._column[name] if name in self.parameters else build.constant(c))
        for head, a, b in zip(F.heads.tolist(), F.left.tolist(), F.right.tolist(), strict=True):
            number.append(build.apply(Operator(head), number[a], number[b] if b >= 0 else -1))
        return [number[end] for end in F.outputs.tolist()]

    def map(self, functions: list[Function]) -> Map:
        """Return the map with these rows."""
        return self.build.finish(self.value(function) for function in functions)

    def value(self, function: Function) -> int:
        """Return a function in operations: products, then terms, each coefficient before its variables, then the
        constant.
        """
        if isinstance(function, Nonlinear):
            return function.value
        apply = self.build.apply
        products, affine = (function.products, function.affine) if isinstance(function, Quadratic) else ([], function)
        terms = [(c if i != j else 0.5 * c, apply(Operator.MUL, i, j)) for i, j, c in products]
        terms += zip(affine.values, affine.columns, strict=True)
        total = -1
        for coefficient, what in terms:
            total = self._added(total, coefficient, what)
        if total < 0:
            return self.build.constant(affine.constant)
        if affine.constant:
            sign = Operator.ADD if affine.constant > 0 else Operator.SUB
            total = apply(sign, total, self.build.constant(abs(affine.constant)))
        return total

    def _added(self, total: int, coefficient: float, what: int) -> int:
        """Return total + coefficient·what; total −1: nothing yet."""
        apply, size = self.build.apply, abs(coefficient)
        if total < 0 and coefficient != -1.0:
            return what if coefficient == 1.0 else apply(Operator.MUL, self.build.constant(coefficient), what)
        term = what if size == 1.0 else apply(Operator.MUL, self.build.constant(size), what)
        if total < 0:
            return apply(Operator.NEG, term)
        return apply(Operator.SUB if coefficient < 0 else Operator.ADD, total, term)

    def bare(self, function: Function) -> int | None:
        """Return the variable that a function consists of, None where it is more."""
        if isinstance(function, Nonlinear):
            return function.value if function.value < self._inputs else None
        affine = function.affine if isinstance(function, Quadratic) and not function.products else function
        if isinstance(affine, Affine) and affine.values == [1.0] and affine.constant == 0.0:
            return affine.columns[0] if affine.columns[0] < self._inputs else None
        return None

    # --------------------------------------------------------------------------------------- reading

    def scalar(self, function: Any, where: str) -> Function:
        """Return the one value of a function; raises FormatError."""
        rows = self.rows(function, where)
        if len(rows) != 1:
            raise self._fields.refused(where, f"has {len(rows)} values, expected one")
        return rows[0]

    def rows(self, function: Any, where: str) -> list[Function]:
        """Return the values of a scalar or a vector function; raises FormatError."""
        fields = self._fields
        kind = fields.get(function, "type", str, where)
        if kind == "Variable":
            return [self._one(function.get("name"), where)]
        if kind == "VectorOfVariables":
            return [self._one(name, where) for name in fields.get(function, "variables", list, where)]
        if kind == "ScalarAffineFunction":
            return [self._affine(function, "terms", where)]
        if kind == "ScalarQuadraticFunction":
            affine = self._affine(function, "affine_terms", where)
            terms = fields.items(function, "quadratic_terms", where)
            return [Quadratic([self._product(t, f"{where}/quadratic_terms/{k}") for k, t in terms], affine)]
        if kind == "VectorAffineFunction":
            return [*self._vector(function, "terms", where)]
        if kind == "VectorQuadraticFunction":
            affines = self._vector(function, "affine_terms", where)
            rows = [Quadratic([], affine) for affine in affines]
            for k, term in fields.items(function, "quadratic_terms", where):
                row, inner = self._indexed(term, len(rows), f"{where}/quadratic_terms/{k}")
                rows[row].products.append(self._product(inner, f"{where}/quadratic_terms/{k}"))
            return [*rows]
        if kind == "ScalarNonlinearFunction":
            terms = MofTerms(fields, self._column, self.build, function, where)
            if "root" not in function:
                raise fields.refused(f"{where}/root", "is missing, expected a term")
            return [Nonlinear(terms.value(function["root"], f"{where}/root"))]
        if kind == "VectorNonlinearFunction":
            terms = MofTerms(fields, self._column, self.build, function, where)
            return [Nonlinear(terms.value(t, f"{where}/rows/{k}")) for k, t in fields.items(function, "rows", where)]
        raise fields.refused(
            where, f"is a {shown(kind)}, expected a variable, or an Affine, Quadratic or NonlinearFunction"
        )

    def _one(self, name: Any, where: str) -> Affine:
        return Affine([self._fields.variable(self._column, name, where)], [1.0], 0.0)

    def _affine(self, function: Any, key: str, where: str) -> Affine:
        fields = self._fields
        columns: list[int] = []
        values: list[float] = []
        for k, term in fields.items(function, key, where):
            here = f"{where}/{key}/{k}"
            columns.append(fields.variable(self._column, fields.get(term, "variable", str, here), here))
            values.append(fields.number(term, "coefficient", here))
        return Affine(columns, values, fields.number(function, "constant", where))

    def _vector(self, function: Any, key: str, where: str) -> list[Affine]:
        fields = self._fields
        constants = fields.get(function, "constants", list, where)
        rows = [Affine([], [], fields.finite(c, f"{where}/constants/{k}")) for k, c in enumerate(constants)]
        for k, term in fields.items(function, key, where):
            here = f"{where}/{key}/{k}"
            row, inner = self._indexed(term, len(rows), here)
            name = fields.get(inner, "variable", str, here)
            rows[row].columns.append(fields.variable(self._column, name, here))
            rows[row].values.append(fields.number(inner, "coefficient", here))
        return rows

    def _indexed(self, term: Any, rows: int, where: str) -> tuple[int, Any]:
        """Return the row and scalar term of a vector's term."""
        index = self._fields.get(term, "output_index", int, where)
        if not 1 <= index <= rows:
            raise self._fields.refused(where, f"has output_index {shown_number(index)}, expected 1 to {rows}")
        return index - 1, self._fields.get(term, "scalar_term", dict, where)

    def _product(self, term: Any, where: str) -> tuple[int, int, float]:
        fields = self._fields
        i, j = (fields.variable(self._column, fields.get(term, f"variable_{k}", str, where), where) for k in (1, 2))
        return i, j, fields.number(term, "coefficient", where)


# ------------------------------------------------------------------------------------------------------ nonlinear terms
# Terms of MathOptFormat's nonlinear functions: trees that may refer to terms in a `node_list`, in any order but in no
# circle. They are gone through with a stack of our own, and no term of the list twice: time and memory are in
# proportion to the text.

_UNSEEN, _OPEN = -1, -2


@dataclass(slots=True)
class _Frame:
    """An operation whose arguments are being found; head "" for an entry of the list."""

    head: str
    arguments: list[Any]
    node: int = -1
    at: int = 0
    values: list[int] = field(default_factory=list)


class MofTerms:
    """The terms of one nonlinear function."""

    def __init__(self, fields: Fields, column: Mapping[str, int], build: Builder, function: Any, where: str) -> None:
        self._fields, self._column, self._build = fields, column, build
        self._nodes: list[Any] = self._fields.get(function, "node_list", list, where)
        self._found = [_UNSEEN] * len(self._nodes)
        self._where = self._top = where
        self._stack: list[_Frame] = []

    def value(self, term: Any, where: str) -> int:
        """Return the number of a term's value; raises FormatError."""
        self._top, stack = where, self._stack
        try:
            result = self._enter(term)
            while stack:
                frame = stack[-1]
                result = self._next(frame)
                if result < 0:
                    continue
                stack.pop()
                if frame.node >= 0:
                    self._found[frame.node] = result
                if stack:
                    stack[-1].values.append(result)
        except ProblemError as cause:  # more operations than a map may have
            raise self._refused(cause.cause) from None
        return result

    def _next(self, frame: _Frame) -> int:
        """Return the value of a frame, −1 when an argument has to be evaluated first."""
        column = self._column
        for k in range(frame.at, len(frame.arguments)):
            argument = frame.arguments[k]
            result = column.get(argument, -1) if isinstance(argument, str) else -1
            if result < 0:
                result = self._enter(argument)
            if result < 0:
                frame.at = k + 1
                return -1
            frame.values.append(result)
        frame.at = len(frame.arguments)
        if not frame.head:
            return frame.values[0]
        result = combine(self._build, frame.head, frame.values)
        if result is None:
            raise self._refused(
                f"has {len(frame.values)} arguments of {frame.head}, which takes another number of them"
            )
        return result

    def _enter(self, term: Any) -> int:
        """Return the value of a term, −1 when it has arguments, which now wait on the stack."""
        if isinstance(term, str):
            column = self._column.get(term)
            return column if column is not None else self._variable(term)
        if isinstance(term, float) and math.isfinite(term):
            return self._build.constant(term)
        if isinstance(term, int | float):
            return self._constant(term)
        kind: Any = term.get("type") if isinstance(term, dict) else None
        if kind == "node":
            return self._node(term.get("index"))
        if kind == "variable":
            return self._variable(term.get("name"))
        if kind == "real":
            return self._constant(term.get("value"))
        if not isinstance(kind, str):
            raise self._refused(f"is a {type(term).__name__} without a type, expected a term")
        if kind not in KNOWN:
            raise self._refused(f"has the operator '{shown(kind)}', which cannot be expressed by those of a map")
        arguments = term.get("args")
        if not isinstance(arguments, list):
            raise self._refused(f"has no list of args beside '{shown(kind)}'")
        self._stack.append(_Frame(kind, arguments))
        return -1

    def _node(self, index: Any) -> int:
        if not isinstance(index, int) or isinstance(index, bool) or not 1 <= index <= len(self._nodes):
            raise self._refused(f"refers to node '{shown_number(index)}', expected 1 to {len(self._nodes)}")
        result = self._found[index - 1]
        if result == _OPEN:
            raise self._refused(f"refers to node {index}, which refers back to it: a function has no circles")
        if result == _UNSEEN:
            self._found[index - 1] = _OPEN
            self._stack.append(_Frame("", [self._nodes[index - 1]], node=index - 1))
            return -1
        return result

    def _variable(self, name: Any) -> int:
        return self._fields.variable(self._column, name, self._place())

    def _constant(self, value: Any) -> int:
        return self._build.constant(self._fields.finite(value, self._place()))

    def _place(self) -> str:
        node = next((frame.node for frame in reversed(self._stack) if frame.node >= 0), None)
        return self._top if node is None else f"{self._where}/node_list/{node}"

    def _refused(self, cause: str) -> Exception:
        return self._fields.refused(self._place(), cause)
