"""Conditions on problems: `3*nc/ndof > 1 and node != 'fc'`, and words as `murty or (chain and not 3d)`.

Python's parser reads them, `_Reader` takes what it knows of the tree, and nothing is ever executed as Python. What a
problem does not have is unknown, and so is a division by zero; unknown spreads through arithmetic and comparisons, and
through `and`, `or`, `not` as in Kleene's logic: `nc > 3 or node == 'lcp'` selects an LCP, which has no nc. Only what is
known to hold is selected.
"""

from __future__ import annotations

import ast
import difflib
import math
import operator
import re
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeAlias

from cpbench.errors import CpbenchError

Value: TypeAlias = float | str | bool | None
"""A number, a text, a truth value, or None: unknown."""
Facts: TypeAlias = Mapping[str, float | str]

LONGEST, DEEPEST = 2000, 50
"""Most characters of a condition, and deepest nesting of operations."""
NUMBER, TEXT, TRUTH = "number", "text", "condition"
ALLOWED = "write numbers, 'texts', facts, + - * / // % **, < <= == != > >=, and, or, not, ()"
_COMPARE: Mapping[type[ast.AST], Callable[..., Any]] = {
    ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}  # fmt: skip
_CALCULATE: Mapping[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv, ast.Pow: math.pow,
    ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod, ast.UAdd: operator.pos, ast.USub: operator.neg,
}  # fmt: skip


class ExpressionError(CpbenchError):
    """A condition cannot be read; the message shows the place."""


@dataclass(frozen=True)
class Expression:
    """A part of a condition as read: its kind (number, text or condition), and how to find its value."""

    kind: str
    value: Callable[[Facts], Value]

    def holds(self, facts: Facts) -> bool:
        """Tell whether the condition is known to hold."""
        return self.value(facts) is True


def condition(text: str, known: Mapping[str, type]) -> Expression:
    """Read the condition `text` on facts of the names and types `known` (float or str); raises ExpressionError.

    >>> condition("1 < nc/2 <= 3", {"nc": float}).holds({"nc": 6})
    True
    >>> condition("not nc > 100", {"nc": float}).holds({})
    False
    """

    def fact(name: str) -> Expression:
        return Expression(TEXT if known[name] is str else NUMBER, lambda facts: facts.get(name))

    return _Reader(text, {name: fact(name) for name in known}).read()


def words(text: str) -> Expression:
    """Read the condition that words occur in the texts of a problem, whatever their case; with and, or, not, ().

    >>> words("chain and not 3d").holds({"name": "Chain-2D", "family": "chains"})
    True
    """
    known: dict[str, Expression] = {}

    def named(found: re.Match[str]) -> str:  # by a name that Python takes
        word = found[0].lower()
        known[f"w{len(known)}"] = Expression(TRUTH, lambda facts: any(word in str(v).lower() for v in facts.values()))
        return f"w{len(known) - 1}"

    try:
        return _Reader(re.sub(r"(?!(?:and|or|not)(?![^\s()]))(?<![^\s()])[^\s()]+", named, text), known).read()
    except ExpressionError:
        raise ExpressionError(
            f"'{text}': cannot be read: write words with 'and', 'or', 'not', () between them"
        ) from None


class _Reader:
    """The reader of one text, in which names stand for expressions."""

    def __init__(self, text: str, known: Mapping[str, Expression]) -> None:
        if len(text) > LONGEST:
            raise ExpressionError(f"'{text[:40]}...': has {len(text)} characters, at most {LONGEST} are read")
        self._text, self._known = re.sub(r"\s", " ", text).strip(), known

    def read(self) -> Expression:
        if "\0" in self._text:
            raise self._refused(self._text, f"has a null character; {ALLOWED}")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")  # what only may be a mistake is refused, too
                tree = ast.parse(self._text, mode="eval")
        except SyntaxError as error:
            why = error.msg.replace(" or ':='", "")
            raise self._refused(self._text[(error.offset or len(self._text) + 1) - 1 :], f"{why}; {ALLOWED}") from None
        except (ValueError, MemoryError, RecursionError):  # a tree too deep for the parser
            raise self._refused(self._text, f"cannot be read; {ALLOWED}") from None
        return self._read(tree.body, TRUTH, 0)

    def _refused(self, place: str, what: str) -> ExpressionError:
        return ExpressionError(f"'{self._text}': at " + (f"'{place}'" if place else "the end") + f": {what}")

    def _read(self, node: ast.expr, kind: str, depth: int) -> Expression:
        """Read a part that is to be of this kind, '' for any."""
        place = ast.get_source_segment(self._text, node) or ""
        if depth > DEEPEST:
            raise self._refused(place, f"is nested more than {DEEPEST} deep")
        result = self._part(node, place, depth + 1)
        if kind and result.kind != kind:
            raise self._refused(place, f"is a {result.kind}, not a {kind}")
        return result

    def _part(self, node: ast.expr, place: str, depth: int) -> Expression:
        match node:
            case ast.BoolOp(op, parts):
                return _joined([self._read(part, TRUTH, depth) for part in parts], isinstance(op, ast.Or))
            case ast.UnaryOp(ast.Not(), part):
                return _applied(TRUTH, operator.not_, self._read(part, TRUTH, depth))
            case ast.UnaryOp(op, part) if type(op) in _CALCULATE:
                return _applied(NUMBER, _CALCULATE[type(op)], self._read(part, NUMBER, depth))
            case ast.BinOp(a, op, b) if type(op) in _CALCULATE:
                return _applied(NUMBER, _CALCULATE[type(op)], *(self._read(part, NUMBER, depth) for part in (a, b)))
            case ast.Compare(first, ops, others) if all(type(op) in _COMPARE for op in ops):
                terms = [self._read(part, "", depth) for part in (first, *others)]
                for a, b in pairwise(terms):
                    if a.kind != b.kind or a.kind == TRUTH:
                        raise self._refused(place, f"a {a.kind} cannot be compared with a {b.kind}")
                links = zip(ops, pairwise(terms), strict=True)
                return _joined([_applied(TRUTH, _COMPARE[type(op)], *both) for op, both in links], decisive=False)
            case ast.Constant(str() as text):
                return Expression(TEXT, lambda _: text)
            case ast.Constant(int() | float() as number) if not isinstance(number, bool):
                return Expression(NUMBER, lambda _: number)
            case ast.Name(name) if name in self._known:
                return self._known[name]
            case ast.Name(name):
                near = "".join(f"did you mean {n}? " for n in difflib.get_close_matches(name, self._known, n=1))
                raise self._refused(place, f"unknown fact {name}: {near}Known are {', '.join(sorted(self._known))}")
            case _:
                raise self._refused(place, f"cannot be read; {ALLOWED}")


def _joined(parts: list[Expression], decisive: bool) -> Expression:
    """Join by `or` (decided by a True) or `and` (by a False); unknown when only an unknown could decide."""

    def value(facts: Facts) -> Value:
        values = [part.value(facts) for part in parts]
        return decisive if decisive in values else None if None in values else not decisive

    return Expression(TRUTH, value)


def _applied(kind: str, operation: Callable[..., Any], *parts: Expression) -> Expression:
    """Apply an operation to floats, so that no power takes long; unknown where the result is not finite."""

    def value(facts: Facts) -> Value:
        values = [part.value(facts) for part in parts]
        if None in values:
            return None
        try:
            result = operation(*(float(v) if type(v) is int else v for v in values))
        except (ArithmeticError, ValueError):
            return None
        return result if math.isfinite(result) else None

    return Expression(kind, value)
