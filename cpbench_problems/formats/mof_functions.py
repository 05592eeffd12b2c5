"""Functions of MathOptFormat, scalar and vector: affine, quadratic and nonlinear ones, as values of one map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from cpbench.errors import FormatError, ProblemError
from cpbench.formulations.expressions.map import Builder, Map
from cpbench.formulations.expressions.operators import Operator
from cpbench_problems.formats.mof_json import Fields, shown, shown_number
from cpbench_problems.formats.mof_terms import MofTerms


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
