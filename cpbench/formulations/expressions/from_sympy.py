"""SymPy expressions as a map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cpbench.errors import ProblemError
from cpbench.formulations.expressions.map import Builder, Map
from cpbench.formulations.expressions.operators import Operator

_UNARY = {
    "Abs": "ABS", "exp": "EXP", "log": "LOG", "sin": "SIN", "cos": "COS", "tan": "TAN", "asin": "ASIN", "acos": "ACOS",
    "atan": "ATAN", "sinh": "SINH", "cosh": "COSH", "tanh": "TANH", "asinh": "ASINH", "acosh": "ACOSH",
    "atanh": "ATANH", "erf": "ERF", "floor": "FLOOR", "ceiling": "CEIL", "Not": "NOT",
}  # fmt: skip
_MANY = {"Add": "ADD", "Mul": "MUL", "Min": "MIN", "Max": "MAX", "And": "AND", "Or": "OR"}
_BINARY = {"atan2": "ATAN2", "StrictLessThan": "LT", "LessThan": "LE", "Equality": "EQ"}
_TURNED = {"StrictGreaterThan": "LT", "GreaterThan": "LE"}


def read(variables: Sequence[Any], outputs: Sequence[Any], parameters: Mapping[str, float]) -> Map:
    """Return the map from symbols to expressions in them and in the symbols named in `parameters`; raises ProblemError
    on a function or symbol that a map has not.
    """
    return _Reader(variables, parameters).map(outputs)


class _Reader:
    def __init__(self, variables: Sequence[Any], parameters: Mapping[str, float]) -> None:
        self._build = Builder(len(variables))
        self._parameters = parameters
        self._known: dict[Any, int] = {symbol: k for k, symbol in enumerate(variables)}

    def map(self, outputs: Sequence[Any]) -> Map:
        import sympy

        return self._build.finish([self._value(sympy.sympify(e)) for e in outputs])

    def _value(self, expression: Any) -> int:
        result = self._known.get(expression)
        if result is None:
            result = self._known[expression] = self._converted(expression)
        return result

    def _converted(self, e: Any) -> int:
        if e.is_Number or e.is_NumberSymbol:
            return self._build.constant(float(e))
        if e.is_Symbol:
            if e.name not in self._parameters:
                raise ProblemError("map", f"has the symbol {e.name}, which is not a variable: give it in parameters")
            return self._build.parameter(e.name, self._parameters[e.name])
        name = type(e).__name__
        if name == "Pow":
            return self._power(e.base, e.exp)
        if name == "Piecewise":
            return self._piecewise(list(e.args))
        if name == "sign":
            return self._sign(self._value(e.args[0]))
        arguments = [self._value(a) for a in e.args] if e.args else []
        if name in _UNARY:
            return self._build.apply(Operator[_UNARY[name]], arguments[0])
        if name in _BINARY:
            return self._build.apply(Operator[_BINARY[name]], *arguments)
        if name == "Unequality":
            return self._build.apply(Operator.NOT, self._build.apply(Operator.EQ, *arguments))
        if name in _TURNED:
            return self._build.apply(Operator[_TURNED[name]], *reversed(arguments))
        if name in _MANY:
            total = arguments[0]
            for argument in arguments[1:]:
                total = self._build.apply(Operator[_MANY[name]], total, argument)
            return total
        if e.is_Boolean and not e.args:
            return self._build.constant(1.0 if bool(e) else 0.0)
        raise ProblemError("map", f"has SymPy's {name} in {str(e)[:60]}, which is not a function of a map")

    def _power(self, base: Any, exponent: Any) -> int:
        from sympy import Rational

        value, apply = self._value(base), self._build.apply
        if exponent == -1:
            return apply(Operator.DIV, self._build.constant(1.0), value)
        if exponent in (Rational(1, 2), Rational(-1, 2)):
            root = apply(Operator.SQRT, value)
            return root if exponent > 0 else apply(Operator.DIV, self._build.constant(1.0), root)
        if exponent == 2:
            return apply(Operator.MUL, value, value)  # as CasADi has it
        return apply(Operator.POW, value, self._value(exponent))

    def _piecewise(self, pieces: list[Any]) -> int:
        """Return the first piece whose condition holds; NaN has no place in a map: the last condition must be True."""
        apply = self._build.apply
        value, condition = pieces[0].args
        if condition == True:  # noqa: E712 - SymPy's own truth
            return self._value(value)
        if len(pieces) == 1:
            raise ProblemError("map", "has a Piecewise whose last condition is not True")
        holds = self._value(condition)
        rest = self._piecewise(pieces[1:])
        here = apply(Operator.CHOOSE, holds, self._value(value))
        return apply(Operator.ADD, here, apply(Operator.CHOOSE, apply(Operator.NOT, holds), rest))

    def _sign(self, value: int) -> int:
        apply, constant = self._build.apply, self._build.constant
        up = apply(Operator.CHOOSE, apply(Operator.LT, constant(0.0), value), constant(1.0))
        return apply(Operator.SUB, up, apply(Operator.CHOOSE, apply(Operator.LT, value, constant(0.0)), constant(1.0)))
