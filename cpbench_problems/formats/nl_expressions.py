"""Expressions of .nl files, in which operators stand before their arguments, as values of a map."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from cpbench.errors import ProblemError
from cpbench.formulations.expressions.map import Builder
from cpbench_problems.formats.nl_operators import applied, arity, is_condition
from cpbench_problems.formats.nl_source import NLSource


@dataclass(slots=True)
class _Open:
    """An operation whose arguments are being read."""

    code: int
    count: int
    arguments: list[int] = field(default_factory=list[int])


class NLExpressions:
    """Reader of the expressions of a file. defined : the values of its defined variables."""

    def __init__(self, source: NLSource, build: Builder, defined: Mapping[int, int]) -> None:
        self._source, self._build, self._defined = source, build, defined

    def read(self) -> int:
        """Return the value of the expression that begins here; raises FormatError."""
        waiting: list[_Open] = []
        try:
            while True:
                opened = self._item()
                if isinstance(opened, _Open):
                    waiting.append(opened)
                    continue
                value = opened
                while waiting:
                    top = waiting[-1]
                    top.arguments.append(value)
                    if len(top.arguments) < top.count:
                        break
                    waiting.pop()
                    above = waiting[-1] if waiting else None
                    condition = above is not None and is_condition(above.code, len(above.arguments))
                    value = applied(self._build, top.code, top.arguments, condition)
                else:
                    return value
        except ProblemError as cause:  # too many operations
            self._source.refuse(cause.cause)

    def _item(self) -> int | _Open:
        """Return the value of a number or a variable, or the operation that begins here."""
        source, build = self._source, self._build
        kind = source.key()
        match kind:
            case "o":
                return self._operation()
            case "n":
                value = build.constant(source.finite())
            case "s":
                value = build.constant(source.short())
            case "l":
                value = build.constant(source.long())
            case "v":
                number = source.whole()
                if number >= build.inputs and number not in self._defined:
                    source.refuse(
                        f"has v{number}, which is no variable (0 to {build.inputs - 1}), and none defined above"
                    )
                value = self._defined[number] if number >= build.inputs else number
            case "f" | "h":
                source.refuse("calls an imported function, and cpbench runs none")
            case "":
                source.refuse("ends here, in the middle of an expression")
            case _:
                source.refuse(f"has {kind!a}, expected an operator (o), a number (n, s, l) or a variable (v)")
        source.end()
        return value

    def _operation(self) -> _Open:
        source = self._source
        code = source.whole()
        count = arity(code)
        if count is None:
            source.refuse(f"has the operator o{code}, which cannot be expressed by those of a map")
        source.end()
        if not count:
            source.line()
            count = source.whole()
            source.end()
            if not count:
                source.refuse(f"has the operator o{code} without an argument")
        return _Open(code, count)
