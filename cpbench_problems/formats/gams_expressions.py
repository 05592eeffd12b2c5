"""Expressions of GAMS as values of a map.

Signs bind as in GAMS: ** before * and /, these before + and -, which a sign at the beginning is one of; all from the
left. The square x**2 is x·x, also for negative x, where GAMS would refuse it; x**y is defined for x < 0 where y is
whole. There is a stack of our own, so that no depth of brackets ends in an error of Python.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import add, mul, sub, truediv

from cpbench.errors import ProblemError
from cpbench.formulations.expressions.map import Builder
from cpbench.formulations.expressions.operators import Operator
from cpbench_problems.formats.gams_statements import Tokens
from cpbench_problems.formats.mof_operators import combine

_SAME = {
    **{name: name for name in ("abs", "ceil", "cos", "cosh", "exp", "floor", "log", "log10", "log2", "max", "min")},
    **{name: name for name in ("sin", "sinh", "sqrt", "tan", "tanh")},
    **{"arccos": "acos", "arcsin": "asin", "arctan": "atan", "arctan2": "atan", "sqr": "abs2"},
    **dict.fromkeys(("power", "rpower", "vcpower", "cvpower"), "^"),
}
"""Functions that MathOptFormat has too, under that name."""
_WITH_TWO = frozenset({"arctan2", "power", "rpower", "vcpower", "cvpower"})
_MANY = frozenset({"min", "max"})
FUNCTIONS = (*sorted(_SAME), "div", "errorf")
_SIGNS: Mapping[str, tuple[int, Operator]] = {
    "+": (1, Operator.ADD),
    "-": (1, Operator.SUB),
    "*": (2, Operator.MUL),
    "/": (2, Operator.DIV),
    "**": (3, Operator.POW),
}
_FOLDED: Mapping[Operator, Callable[[float, float], float]] = {
    Operator.ADD: add,
    Operator.SUB: sub,
    Operator.MUL: mul,
    Operator.DIV: truediv,
}
"""Of two numbers they are computed at once: as exact as later."""


@dataclass(slots=True)
class _Open:
    """A bracket, or the call of a function, that is not closed yet. arguments : those that are complete."""

    function: str
    line: int
    arguments: list[int]


_Waiting = _Open | str
"""A bracket, or the sign of an operation whose right argument is not complete; `neg` is a sign before a term."""


class GAMSExpressions:
    """Reader of the expressions of a text. variable : the value of a name, None where it is unknown."""

    def __init__(self, tokens: Tokens, build: Builder, variable: Callable[[str], int | None]) -> None:
        self._tokens, self._build, self._variable = tokens, build, variable
        self._values: list[int] = []
        self._waiting: list[_Waiting] = []

    def read(self) -> int:
        """Return the value of the expression that begins here; raises FormatError."""
        self._values, self._waiting = [], []
        try:
            while True:
                self._operand()
                if not self._operator():
                    return self._values[0]
        except ProblemError as cause:  # too many operations
            self._tokens.refuse(cause.cause)

    def _operand(self) -> None:
        """Read up to the end of a number or a variable, with what opens before it."""
        tokens, first = self._tokens, not self._waiting or isinstance(self._waiting[-1], _Open)
        while True:
            token = tokens.next
            if token.kind == "number":
                self._values.append(self._constant(float(tokens.advance().text)))
                return
            if token.kind == "name":
                tokens.advance()
                if tokens.accept("("):
                    if token.text not in FUNCTIONS:
                        tokens.refuse(f"calls {token.text}, cpbench reads {', '.join(FUNCTIONS)}", token.line)
                    self._waiting.append(_Open(token.text, token.line, []))
                    first = True
                    continue
                value = self._variable(token.text)
                if value is None:
                    tokens.refuse(f"uses {token.text}, which is no variable of the file", token.line)
                self._values.append(value)
                return
            if tokens.accept("("):
                self._waiting.append(_Open("", token.line, []))
                first = True
            elif token.text in "+-" and token.kind == "sign" and first:
                tokens.advance()
                if token.text == "-":
                    self._waiting.append("neg")
                first = False
            else:
                tokens.refuse(f"has {tokens.shown()}, expected a number, a variable, a function or a bracket")

    def _operator(self) -> bool:
        """Read up to a sign that wants another operand; False at the end of the expression."""
        tokens = self._tokens
        while True:
            token = tokens.next
            if token.kind == "sign" and token.text in _SIGNS:
                tight = _SIGNS[token.text][0]
                if token.text == "**" and self._waiting and self._waiting[-1] == "**":
                    tokens.refuse("has a ** b ** c, which readers take in two ways: write brackets")
                self._reduce(tight)
                self._waiting.append(tokens.advance().text)
                return True
            self._reduce(0)
            if not self._waiting:
                return False
            opened = self._waiting[-1]
            assert isinstance(opened, _Open)  # all signs are reduced
            opened.arguments.append(self._values.pop())
            if opened.function and tokens.accept(","):
                return True
            if not tokens.accept(")"):
                tokens.refuse(f"has {tokens.shown()}, expected ')' of the bracket of line {opened.line}")
            self._waiting.pop()
            self._values.append(self._called(opened))

    def _reduce(self, tight: int) -> None:
        """Carry out the waiting signs that bind at least as tight."""
        while self._waiting and not isinstance(sign := self._waiting[-1], _Open):
            if (1 if sign == "neg" else _SIGNS[sign][0]) < tight:
                return
            self._waiting.pop()
            right = self._values.pop()
            if sign == "neg":
                number = self._build.number(right)
                node = self._constant(-number) if number is not None else self._build.apply(Operator.NEG, right)
            else:
                node = self._applied(_SIGNS[sign][1], self._values.pop(), right)
            self._values.append(node)

    def _applied(self, operator: Operator, left: int, right: int) -> int:
        a, b = self._build.number(left), self._build.number(right)
        if operator is Operator.POW and b == 2.0:
            return self._build.apply(Operator.MUL, left, left)
        if operator in _FOLDED and a is not None and b is not None and (b or operator is not Operator.DIV):
            return self._constant(_FOLDED[operator](a, b))
        return self._build.apply(operator, left, right)

    def _called(self, opened: _Open) -> int:
        """Return the value of a function, or of a bracket."""
        name, given, build = opened.function, opened.arguments, self._build
        if not name:
            return given[0]
        wanted = 2 if name in _WITH_TWO or name == "div" else 1
        if name in _MANY or len(given) == wanted:
            if name == "errorf":  # the normal distribution
                root, half, one = (build.constant(c) for c in (math.sqrt(2.0), 0.5, 1.0))
                erf = build.apply(Operator.ERF, build.apply(Operator.DIV, given[0], root))
                return build.apply(Operator.MUL, half, build.apply(Operator.ADD, one, erf))
            if name == "div":
                return self._applied(Operator.DIV, *given)
            if _SAME[name] == "^":
                return self._power(opened)
            result = combine(build, _SAME[name], given)
            if result is not None:
                return result
        self._tokens.refuse(f"gives {name} {len(given)} arguments, expected {wanted}", opened.line)

    def _power(self, opened: _Open) -> int:
        exponent = self._build.number(opened.arguments[1])
        if opened.function == "power" and (exponent is None or exponent != int(exponent)):
            self._tokens.refuse("has power with an exponent that is no whole number: write **", opened.line)
        return self._applied(Operator.POW, *opened.arguments)

    def _constant(self, value: float) -> int:
        if not math.isfinite(value):
            self._tokens.refuse(f"has the number {value}, expected one below 1.8e308")
        return self._build.constant(value)
