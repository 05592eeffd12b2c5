"""Maps as expressions of .nl files, in text (g) and binary (b), which read back as the same operations.

What is used once stands inside what uses it; what is used again, or would nest deeper than DEPTH, is a defined variable
(V). Sums of more than two terms are one operator with a list.
"""

from __future__ import annotations

import struct
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from cpbench.formulations.expressions.map import Map
from cpbench.formulations.expressions.operators import Operator
from cpbench_problems.formats.mof_functions import Affine, Functions, Quadratic
from cpbench_problems.formats.nl_operators import CONDITIONS, IF, NOT_EQUAL, SUM, WRITTEN
from cpbench_problems.formats.plain_rows import PlainRows

DEPTH = 200
"""Operators inside each other: readers written with recursion take that."""


class Encoder(ABC):
    """One of the two ways of writing. letter : with which a file begins; arithmetic : in its header, 0 for text."""

    letter: str
    arithmetic: int

    @abstractmethod
    def key(self, key: str, *wholes: int) -> bytes:
        """Return the beginning of a segment, an operator or a variable, with whole numbers."""

    @abstractmethod
    def entry(self, whole: int, number: float | None = None) -> bytes:
        """Return an entry without a key."""

    @abstractmethod
    def numbers(self, key: str, *numbers: float) -> bytes:
        """Return an entry with a key: a constant, or the interval of a row or a variable."""


class Text(Encoder):
    """Lines. Numbers are written so that they come back bit for bit."""

    letter, arithmetic = "g", 0

    def key(self, key: str, *wholes: int) -> bytes:
        return f"{key}{' '.join(map(str, wholes))}\n".encode()

    def entry(self, whole: int, number: float | None = None) -> bytes:
        return f"{whole}\n".encode() if number is None else f"{whole} {number!r}\n".encode()

    def numbers(self, key: str, *numbers: float) -> bytes:
        between = "" if key == "n" else " "
        return f"{key}{between}{' '.join(map(repr, numbers))}".rstrip().encode() + b"\n"


class Binary(Encoder):
    """Little-endian numbers."""

    letter, arithmetic = "b", 1

    def key(self, key: str, *wholes: int) -> bytes:
        return key.encode() + struct.pack(f"<{len(wholes)}i", *wholes)

    def entry(self, whole: int, number: float | None = None) -> bytes:
        return struct.pack("<i", whole) if number is None else struct.pack("<id", whole, number)

    def numbers(self, key: str, *numbers: float) -> bytes:
        return key.encode() + struct.pack(f"<{len(numbers)}d", *numbers)


@dataclass
class _Chain:
    """A sum: pieces of its terms, without the operator in front."""

    pieces: list[bytes]


class NLTerms:
    """The values of several maps of the same unknowns."""

    def __init__(self, inputs: int, maps: Iterable[Map]) -> None:
        self._functions = Functions("", {str(k): k for k in range(inputs)})
        build = self._functions.build
        self.ends: list[int] = []
        self._operations: dict[int, tuple[int, int, int]] = {}
        for F in maps:
            number = list(range(inputs)) + [build.constant(c) for c in F.constants.tolist()]
            for head, a, b in zip(F.heads.tolist(), F.left.tolist(), F.right.tolist(), strict=True):
                node = (head, number[a], number[b] if b >= 0 else -1)
                number.append(build.apply(Operator(head), *node[1:]))
                self._operations[number[-1]] = node
            self.ends += [number[end] for end in F.outputs.tolist()]
        self._build, self._plain = build, PlainRows(build)

    def affine(self, end: int) -> Affine | None:
        """Return a row as an affine function, None where it would read back as other operations."""
        found = self._plain.function(end)
        if found is None or isinstance(found, Quadratic) or self._functions.value(found) != end:
            return None
        return found if np.all(np.diff(found.columns) > 0) and all(found.values) else None

    def columns(self, end: int) -> list[int]:
        """Return the unknowns that a value depends on."""
        seen: set[int] = set()
        waiting = [end]
        while waiting:
            value = waiting.pop()
            if value >= 0 and value not in seen:
                seen.add(value)
                waiting += self._operations.get(value, (0, -1, -1))[1:]
        return sorted(value for value in seen if value < self._build.inputs)

    def written(self, ends: Sequence[int], encoder: Encoder) -> tuple[list[bytes], list[bytes]]:
        """Return the defined variables, and an expression for each of the values."""
        members = self._needed(ends)
        uses: dict[int, int] = {}
        for value in (*ends, *(a for k in members for a in self._operations[k][1:])):
            uses[value] = uses.get(value, 0) + 1
        writer = _Writer(self._build.number, self._build.inputs, encoder)
        for value in members:
            writer.add(value, self._operations[value], shared=uses[value] > 1)
        return writer.defined, [writer.text(end) for end in ends]

    def _needed(self, ends: Sequence[int]) -> list[int]:
        """Return the operations that values need, arguments before their users."""
        seen: set[int] = set()
        waiting = list(ends)
        while waiting:
            value = waiting.pop()
            if value in self._operations and value not in seen:
                seen.add(value)
                waiting += self._operations[value][1:]
        return sorted(seen)


class _Writer:
    def __init__(self, number: Callable[[int], float | None], inputs: int, encoder: Encoder) -> None:
        self._number, self._inputs, self._to = number, inputs, encoder
        self._texts: dict[int, bytes | _Chain] = {}
        self._depth: dict[int, int] = {}
        self._conditions: dict[int, bytes] = {}
        self.defined: list[bytes] = []

    def text(self, value: int) -> bytes:
        """Return a value as an expression."""
        if value < self._inputs:
            return self._to.key("v", value)
        result = self._texts.get(value)
        if result is None:
            number = self._number(value)
            assert number is not None  # what is neither an unknown nor an operation
            return self._to.numbers("n", number)
        if isinstance(result, bytes):
            return result
        if len(result.pieces) == 2:
            return self._to.key("o", WRITTEN[Operator.ADD]) + b"".join(result.pieces)
        return self._to.key("o", SUM) + self._to.entry(len(result.pieces)) + b"".join(result.pieces)

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
            number = self._inputs + len(self.defined)
            self.defined.append(self._to.key("V", number, 0, 0) + self.text(value))
            self._texts[value], self._depth[value] = self._to.key("v", number), 0
            self._conditions.pop(value, None)

    def _written(self, value: int, head: Operator, a: int, b: int) -> bytes:
        to = self._to
        zero, one = to.numbers("n", 0.0), to.numbers("n", 1.0)
        if head is Operator.CHOOSE:
            return to.key("o", IF) + self._condition(a) + self.text(b) + zero
        code = to.key("o", WRITTEN[head])
        if head in CONDITIONS:
            logical = head in (Operator.AND, Operator.OR, Operator.NOT)
            arguments = [self._condition(k) if logical else self.text(k) for k in ((a, b) if b >= 0 else (a,))]
            self._conditions[value] = code + b"".join(arguments)
            return to.key("o", IF) + self._conditions[value] + one + zero
        if head in (Operator.MIN, Operator.MAX):
            code += to.entry(2)
        return code + self.text(a) + (self.text(b) if b >= 0 else b"")

    def _condition(self, value: int) -> bytes:
        to = self._to
        return self._conditions.get(value) or to.key("o", NOT_EQUAL) + self.text(value) + to.numbers("n", 0.0)
