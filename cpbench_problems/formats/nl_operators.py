"""Operators of .nl files by their numbers, and what each is in operations of a map.

The numbers are from D. M. Gay, Writing .nl Files (Sandia report SAND2005-7907P). A condition is a comparison, and, or,
not; it stands in an `if` or in another condition alone. As a number it is written if(condition, 1, 0), and the
condition that a number x is is x != 0, so that both read back as the same operation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from cpbench.errors import ProblemError
from cpbench.formulations.expressions.map import Builder
from cpbench.formulations.expressions.operators import Operator
from cpbench_problems.formats.mof_operators import combine
from cpbench_problems.formats.nl_source import NLSource

SAME: Mapping[int, Operator] = {
    0: Operator.ADD, 1: Operator.SUB, 2: Operator.MUL, 3: Operator.DIV, 5: Operator.POW, 13: Operator.FLOOR,
    14: Operator.CEIL, 15: Operator.ABS, 16: Operator.NEG, 20: Operator.OR, 21: Operator.AND, 22: Operator.LT,
    23: Operator.LE, 24: Operator.EQ, 34: Operator.NOT, 37: Operator.TANH, 38: Operator.TAN, 39: Operator.SQRT,
    40: Operator.SINH, 41: Operator.SIN, 43: Operator.LOG, 44: Operator.EXP, 45: Operator.COSH, 46: Operator.COS,
    47: Operator.ATANH, 48: Operator.ATAN2, 49: Operator.ATAN, 50: Operator.ASINH, 51: Operator.ASIN,
    52: Operator.ACOSH, 53: Operator.ACOS, 76: Operator.POW, 78: Operator.POW,
}  # fmt: skip
"""Operators that are those of a map."""
MANY: Mapping[int, Operator] = {11: Operator.MIN, 12: Operator.MAX, 54: Operator.ADD}
"""With a number of arguments that stands behind the operator."""
_FORMULAS: Mapping[int, tuple[str, int]] = {
    28: (">=", 2), 29: (">", 2), 35: ("ifelse", 3), 42: ("log10", 1), 77: ("abs2", 1)
}  # fmt: skip
"""Operators that MathOptFormat's are: name and number of arguments."""
LESS, OR, AND, NOT_EQUAL, NOT, IF, SUM = 6, 20, 21, 30, 34, 35, 54
CONDITIONS = frozenset({Operator.NOT, Operator.AND, Operator.OR, Operator.LT, Operator.LE, Operator.EQ})
WRITTEN: Mapping[Operator, int] = {
    **{operator: code for code, operator in SAME.items() if code < 76},
    Operator.MIN: 11,
    Operator.MAX: 12,
}
"""Number of each operator in files; CHOOSE(a, b) is if(a, b, 0)."""
UNWRITTEN = frozenset(Operator) - WRITTEN.keys() - {Operator.CHOOSE}
"""Operators that no number has."""


def is_condition(code: int, argument: int) -> bool:
    """Return whether an argument of an operator is used as a condition."""
    return code in (NOT, OR, AND) or (code == IF and argument == 0)


def arity(code: int) -> int | None:
    """Return how many arguments an operator has, 0 where a number behind it says so, None where it is not read."""
    if code in MANY:
        return 0
    if code in SAME:
        return 2 if SAME[code].binary else 1
    if code in (LESS, NOT_EQUAL):
        return 2
    return _FORMULAS[code][1] if code in _FORMULAS else None


def applied(build: Builder, code: int, arguments: list[int], condition: bool) -> int:
    """Return the value of an operation with the right number of arguments; `condition`: it is used as one."""
    if code in SAME:
        return build.apply(SAME[code], *arguments)
    if code in MANY:
        total = arguments[0]
        for argument in arguments[1:]:
            total = build.apply(MANY[code], total, argument)
        return total
    if code == LESS:
        return build.apply(Operator.MAX, build.apply(Operator.SUB, *arguments), build.constant(0.0))
    if code == NOT_EQUAL:
        if condition and build.number(arguments[1]) == 0.0:
            return arguments[0]
        return build.apply(Operator.NOT, build.apply(Operator.EQ, *arguments))
    if code == IF and build.number(arguments[1]) == 1.0 and build.number(arguments[2]) == 0.0:
        operation = build.operation(arguments[0])
        if operation is not None and operation[0] in CONDITIONS:
            return arguments[0]
    result = combine(build, _FORMULAS[code][0], arguments)
    assert result is not None  # the number of arguments is right
    return result


# ---------------------------------------------------------------------------------------------------------- expressions


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
