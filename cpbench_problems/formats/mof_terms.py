"""Terms of MathOptFormat's nonlinear functions: trees that may refer to terms in a `node_list`, in any order but in no
circle. They are gone through with a stack of our own, and no term of the list twice: time and memory are in proportion
to the text.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from cpbench.errors import ProblemError
from cpbench.formulations.expressions.map import Builder
from cpbench_problems.formats.mof_json import Fields, shown, shown_number
from cpbench_problems.formats.mof_operators import KNOWN, combine

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
