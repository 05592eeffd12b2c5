"""Writing problems as .nl files, in text.

Rows that are affine are linear terms, all others expressions; the constant of an affine row is in its sides, that of a
pair in its expression. AMPL numbers nonlinear unknowns and rows first; here the order is the problem's, and the header
counts as nonlinear all up to the last one that is.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench.errors import FormatError
from cpbench.formulations.expressions.map import Builder
from cpbench.formulations.expressions.operators import Operator
from cpbench_problems.formats.mof_functions import Affine, Function, Functions, Quadratic
from cpbench_problems.formats.mof_model import Model
from cpbench_problems.formats.nl_operators import CONDITIONS, IF, NOT_EQUAL, SUM, UNWRITTEN, WRITTEN
from cpbench_problems.formats.problem_model import formulation_of, model_of_problem

NODES = frozenset({"nlp", "ncp", "micp", "qp"})
"""Formulations that are written."""


@dataclass
class _Row:
    """A row, or the objective: its expression, its sides, the unknowns in the expression, its linear terms."""

    expression: str
    sides: str
    nonlinear: Sequence[int] = ()
    linear: Affine | None = None

    def terms(self) -> dict[int, float]:
        """Return the linear terms, 0 for unknowns that stand in the expression alone."""
        linear = self.linear or Affine([], [], 0.0)
        return dict.fromkeys(self.nonlinear, 0.0) | dict(zip(linear.columns, linear.values, strict=True))


def obstacle(problem: Any) -> str | None:
    """Return why a problem of a formulation that can be written cannot be, None where it can."""
    for name, F in problem.maps().items():
        unknown = sorted(
            operator.name.lower() for operator in UNWRITTEN & {Operator(int(h)) for h in np.unique(F.heads)}
        )
        if unknown:
            return f"{name} has the operator {unknown[0]}, for which .nl has no number"
    return None


def encoded(problem: Any) -> bytes:
    """Return the file for a problem; raises FormatError."""
    why = obstacle(problem)
    if why is not None:
        raise FormatError(problem.name or problem.node, "", f"cannot be written as nl: {why}")
    model = model_of_problem(problem, parameters=False)
    defined, rows = _parts(model, curved=problem.has_maps())
    objective = rows.pop() if model.objective is not None else None
    remark = f"{' '.join(problem.name.split()).replace('#', '')} (cpbench {formulation_of(problem)})"
    header = _header(model, objective, rows, remark, len(defined)).encode("ascii", "replace")
    return header + "".join((*defined, *_segments(model, objective, rows))).encode()


def _parts(model: Model, *, curved: bool) -> tuple[list[str], list[_Row]]:
    """Return the defined variables and the rows, the last of which is the objective. `curved`: of a problem with maps,
    whose operations are kept as they are.
    """
    functions, build = model.functions, model.functions.build
    split: list[tuple[int, Affine | None, str]] = []
    for kind, rows in (("2", model.above), ("4", model.equal)):
        for row in rows:
            value, linear = _split(functions, row.function)
            constant = linear.constant if linear else 0.0
            side = row.side - constant if constant else row.side
            split.append((build.constant(0.0) if linear else value, linear, f"{kind} {side!r}\n"))
    for k, function in model.pairs.items():
        flags = 1 * bool(np.isfinite(model.lb[k])) + 2 * bool(np.isfinite(model.ub[k]))
        split.append((*_split(functions, function), f"5 {flags} {k + 1}\n"))
    if isinstance(model.objective, Quadratic) and not curved:
        split.append((*_quadratic(model, model.objective), ""))
    elif model.objective is not None:
        split.append((*_split(functions, model.objective), ""))
    defined, texts = written(build, [value for value, _, _ in split])
    return defined, [
        _Row(text, side, columns(build, value), linear)
        for text, (value, linear, side) in zip(texts, split, strict=True)
    ]


def _split(functions: Functions, function: Function) -> tuple[int, Affine | None]:
    """Return the expression and the linear terms of a row: where it reads back from these, its expression is a
    number.
    """
    if isinstance(function, Affine) and all(function.values) and np.all(np.diff(function.columns) > 0):
        return functions.build.constant(function.constant), function
    return functions.value(function), None


def _quadratic(model: Model, function: Quadratic) -> tuple[int, Affine]:
    """Return a sum of products, and the linear terms; raises FormatError."""
    build, affine = model.functions.build, function.affine
    terms: list[int] = []
    for i, j, value in function.products:
        c = 0.5 * value if i == j else value
        if i == j and 2.0 * c != value:
            raise model.refused(f"Q[{i},{i}]", f"is {value}, half of which is no number of a file")
        terms.append(build.apply(Operator.MUL, build.constant(c), build.apply(Operator.MUL, i, j)))
    if affine.constant or not terms:
        terms.append(build.constant(affine.constant))
    kept = [k for k, c in enumerate(affine.values) if c or math.copysign(1.0, c) < 0]
    linear = Affine([affine.columns[k] for k in kept], [affine.values[k] for k in kept], 0.0)
    return functools.reduce(lambda total, term: build.apply(Operator.ADD, total, term), terms), linear


def _header(model: Model, objective: _Row | None, rows: Sequence[_Row], remark: str, defined: int) -> str:
    n, m, pairs = len(model.names), len(rows), len(model.pairs)
    inside = [k for k, row in enumerate(rows) if row.nonlinear]
    by_rows = 1 + max((max(rows[k].nonlinear) for k in inside), default=-1)
    by_objective = 1 + max(objective.nonlinear, default=-1) if objective is not None else 0
    if by_rows and by_objective:  # those of both come first, so that there are no others
        by_rows = by_objective = max(by_rows, by_objective)
    low, both = np.isfinite(model.lb), np.isfinite(model.lb) & np.isfinite(model.ub)
    shifted = int((low & (model.lb != 0.0)).sum())
    ccons = (pairs - len(inside), len(inside), int(both.sum()), shifted) if pairs else (0, 0, 0, 0)
    jacobian = sum(len(row.terms()) for row in rows)
    gradient = len(objective.terms()) if objective is not None else 0
    lines = [
        f"g3 1 1 0\t# problem {remark}",
        f" {n} {m} {int(objective is not None)} 0 {len(model.equal)}\t# vars, constraints, objectives, ranges, eqns",
        f" {1 + inside[-1] if inside else 0} {int(by_objective > 0)} {' '.join(map(str, ccons))}\t"
        "# nonlinear constrs, objs; ccons: lin, nonlin, nd, nzlb",
        " 0 0\t# network constraints: nonlinear, linear",
        f" {by_rows} {by_objective} {min(by_rows, by_objective)}\t# nonlinear vars in constraints, objectives, both",
        " 0 0 0 1\t# linear network variables; functions; arith, flags",
        " 0 0 0 0 0\t# discrete variables: binary, integer, nonlinear (b,c,o)",
        f" {jacobian} {gradient}\t# nonzeros in Jacobian, obj. gradient",
        " 0 0\t# max name lengths: constraints, variables",
        f" {defined} 0 0 0 0\t# common exprs: b,c,o,c1,o1",
    ]
    return "\n".join([*lines, ""])


def _segments(model: Model, objective: _Row | None, rows: Sequence[_Row]) -> Iterator[str]:
    for k, row in enumerate(rows):
        yield f"C{k}\n{row.expression}"
    if objective is not None:
        yield f"O0 0\n{objective.expression}"
    started = [k for k, value in enumerate(model.start.tolist()) if value or math.copysign(1.0, value) < 0]
    if started:
        yield f"x{len(started)}\n"
        yield from (f"{k} {float(model.start[k])!r}\n" for k in started)
    if rows:
        yield "r\n"
        yield from (row.sides for row in rows)
    yield "b\n"
    yield from map(_bounds, model.lb.tolist(), model.ub.tolist())
    counts = np.zeros(len(model.names), dtype=int)
    for row in rows:
        counts[list(row.terms())] += 1
    if rows and counts.size:
        yield f"k{counts.size - 1}\n"
        yield from (f"{count}\n" for count in np.cumsum(counts)[:-1].tolist())
    for k, row in enumerate(rows):
        yield from _linear(f"J{k}", row)
    if objective is not None:
        yield from _linear("G0", objective)


def _linear(key: str, row: _Row) -> Iterator[str]:
    terms = row.terms()
    if terms:
        yield f"{key} {len(terms)}\n"
        yield from (f"{column} {terms[column]!r}\n" for column in sorted(terms))


def _bounds(low: float, high: float) -> str:
    below, above = low > -math.inf, high < math.inf
    if below and above:
        return f"0 {low!r} {high!r}\n" if repr(low) != repr(high) else f"4 {low!r}\n"
    return f"2 {low!r}\n" if below else f"1 {high!r}\n" if above else "3\n"


# ---------------------------------------------------------------------------------------------------------- expressions
# Values of a map as expressions of .nl files, which read back as the same operations.
#
# What is used once stands inside what uses it; what is used again, or would nest deeper than DEPTH, is a defined
# variable (V). Sums of more than two terms are one operator with a list.

DEPTH = 200
"""Operators inside each other: readers written with recursion take that."""
_ZERO, _ONE = "n0.0\n", "n1.0\n"


def columns(build: Builder, end: int) -> list[int]:
    """Return the unknowns that a value depends on."""
    return sorted(value for value in _reached(build, [end]) if value < build.inputs)


def written(build: Builder, ends: Sequence[int]) -> tuple[list[str], list[str]]:
    """Return the defined variables, and an expression for each of the values."""
    operations = {value: node for value in sorted(_reached(build, ends)) if (node := build.operation(value))}
    uses: dict[int, int] = {}
    for value in (*ends, *(a for node in operations.values() for a in node[1:])):
        uses[value] = uses.get(value, 0) + 1
    writer = _Writer(build)
    for value, node in operations.items():
        writer.add(value, node, shared=uses[value] > 1)
    return writer.defined, [writer.text(end) for end in ends]


def _reached(build: Builder, ends: Sequence[int]) -> set[int]:
    """Return the values that these depend on, and themselves."""
    seen: set[int] = set()
    waiting = list(ends)
    while waiting:
        value = waiting.pop()
        if value >= 0 and value not in seen:
            seen.add(value)
            waiting += (build.operation(value) or ())[1:]
    return seen


@dataclass
class _Chain:
    """A sum: texts of its terms, without the operator in front."""

    pieces: list[str]


class _Writer:
    def __init__(self, build: Builder) -> None:
        self._build = build
        self._texts: dict[int, str | _Chain] = {}
        self._depth: dict[int, int] = {}
        self._conditions: dict[int, str] = {}
        self.defined: list[str] = []

    def text(self, value: int) -> str:
        """Return a value as an expression."""
        if value < self._build.inputs:
            return f"v{value}\n"
        result = self._texts.get(value)
        if result is None:
            return f"n{self._build.number(value)!r}\n"  # what is neither an unknown nor an operation
        if isinstance(result, str):
            return result
        if len(result.pieces) == 2:
            return f"o{WRITTEN[Operator.ADD]}\n{''.join(result.pieces)}"
        return f"o{SUM}\n{len(result.pieces)}\n{''.join(result.pieces)}"

    def add(self, value: int, operation: tuple[int, int, int], shared: bool) -> None:
        """Take up an operation whose arguments are there."""
        head, a, b = Operator(operation[0]), operation[1], operation[2]
        left = self._texts.get(a)
        self._depth[value] = 1 + max(self._depth.get(a, 0), self._depth.get(b, 0))
        if head is Operator.ADD and isinstance(left, _Chain):
            left.pieces.append(self.text(b))  # which nothing else uses, or it would be defined
            self._texts[value] = left
            self._depth[value] -= 1
        elif head is Operator.ADD:
            self._texts[value] = _Chain([self.text(a), self.text(b)])
        else:
            self._texts[value] = self._written(value, head, a, b)
        if shared or self._depth[value] >= DEPTH:
            number = self._build.inputs + len(self.defined)
            self.defined.append(f"V{number} 0 0\n{self.text(value)}")
            self._texts[value], self._depth[value] = f"v{number}\n", 0
            self._conditions.pop(value, None)

    def _written(self, value: int, head: Operator, a: int, b: int) -> str:
        if head is Operator.CHOOSE:
            return f"o{IF}\n{self._condition(a)}{self.text(b)}{_ZERO}"
        code = f"o{WRITTEN[head]}\n"
        if head in CONDITIONS:
            logical = head in (Operator.AND, Operator.OR, Operator.NOT)
            arguments = [self._condition(k) if logical else self.text(k) for k in ((a, b) if b >= 0 else (a,))]
            self._conditions[value] = code + "".join(arguments)
            return f"o{IF}\n{self._conditions[value]}{_ONE}{_ZERO}"
        if head in (Operator.MIN, Operator.MAX):
            code += "2\n"
        return code + self.text(a) + (self.text(b) if b >= 0 else "")

    def _condition(self, value: int) -> str:
        return self._conditions.get(value) or f"o{NOT_EQUAL}\n{self.text(value)}{_ZERO}"
