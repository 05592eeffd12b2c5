"""Values of a map as expressions of .nl files, which read back as the same operations.

What is used once stands inside what uses it; what is used again, or would nest deeper than DEPTH, is a defined variable
(V). Sums of more than two terms are one operator with a list.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cpbench.formulations.expressions.map import Builder
from cpbench.formulations.expressions.operators import Operator
from cpbench_problems.formats.nl_operators import CONDITIONS, IF, NOT_EQUAL, SUM, WRITTEN

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
