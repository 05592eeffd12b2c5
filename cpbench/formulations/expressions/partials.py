"""The derivative of every operator by its arguments, as operations: what differentiation of a list goes by.

At a corner one of the one-sided derivatives or their mean is taken, always the same: |x| has 0 at 0, min and max are
their first argument where both are equal. Steps have the derivative 0, also where they jump.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TypeAlias

from cpbench.formulations.expressions.algebra import Algebra
from cpbench.formulations.expressions.operators import Operator

Factor: TypeAlias = Callable[[Algebra, int], int]
"""Factor of a derivative by the argument, of the argument's number."""


def partials(to: Algebra, operator: Operator, a: int, b: int, value: int) -> tuple[Factor | None, Factor | None]:
    """Return the derivatives by the first and the second argument, of the numbers a and b; None where it is 0. `value`
    is the operation's.
    """
    if operator in _UNARY:
        return _times(_UNARY[operator](to, a, value)), None
    if operator in _BINARY:
        return _BINARY[operator](to, a, b, value)
    return None, None


def _times(by: int) -> Factor:
    return lambda to, x: to.mul(by, x)


def _same(to: Algebra, x: int) -> int:
    return x


def _negative(to: Algebra, x: int) -> int:
    return to.neg(x)


def _where(condition: int) -> Factor:
    """Choose, and do not multiply: where the condition is false, the factor may be no number."""
    return lambda to, x: to.apply(Operator.CHOOSE, condition, x)


def _square(to: Algebra, a: int) -> int:
    return to.mul(a, a)


def _reciprocal(to: Algebra, a: int) -> int:
    return to.div(to.one, a)


def _sign(to: Algebra, a: int) -> int:
    return to.sub(to.apply(Operator.LT, to.zero, a), to.apply(Operator.LT, a, to.zero))


def _root(to: Algebra, a: int) -> int:
    return to.apply(Operator.SQRT, a)


_UNARY: Mapping[Operator, Callable[[Algebra, int, int], int]] = {
    Operator.NEG: lambda to, a, v: to.constant(-1.0),
    Operator.ABS: lambda to, a, v: _sign(to, a),
    Operator.SQRT: lambda to, a, v: to.div(to.constant(0.5), v),
    Operator.EXP: lambda to, a, v: v,
    Operator.LOG: lambda to, a, v: _reciprocal(to, a),
    Operator.EXPM1: lambda to, a, v: to.apply(Operator.EXP, a),
    Operator.LOG1P: lambda to, a, v: _reciprocal(to, to.add(to.one, a)),
    Operator.SIN: lambda to, a, v: to.apply(Operator.COS, a),
    Operator.COS: lambda to, a, v: to.neg(to.apply(Operator.SIN, a)),
    Operator.TAN: lambda to, a, v: to.add(to.one, _square(to, v)),
    Operator.ASIN: lambda to, a, v: _reciprocal(to, _root(to, to.sub(to.one, _square(to, a)))),
    Operator.ACOS: lambda to, a, v: to.neg(_reciprocal(to, _root(to, to.sub(to.one, _square(to, a))))),
    Operator.ATAN: lambda to, a, v: _reciprocal(to, to.add(to.one, _square(to, a))),
    Operator.SINH: lambda to, a, v: to.apply(Operator.COSH, a),
    Operator.COSH: lambda to, a, v: to.apply(Operator.SINH, a),
    Operator.TANH: lambda to, a, v: to.sub(to.one, _square(to, v)),
    Operator.ASINH: lambda to, a, v: _reciprocal(to, _root(to, to.add(to.one, _square(to, a)))),
    Operator.ACOSH: lambda to, a, v: _reciprocal(
        to, to.mul(_root(to, to.sub(a, to.one)), _root(to, to.add(a, to.one)))
    ),
    Operator.ATANH: lambda to, a, v: _reciprocal(to, to.sub(to.one, _square(to, a))),
    Operator.ERF: lambda to, a, v: to.mul(
        to.constant(2.0 / math.sqrt(math.pi)), to.apply(Operator.EXP, to.neg(_square(to, a)))
    ),
}


def _add(to: Algebra, a: int, b: int, v: int) -> tuple[Factor | None, Factor | None]:
    return _same, _same


def _sub(to: Algebra, a: int, b: int, v: int) -> tuple[Factor | None, Factor | None]:
    return _same, _negative


def _mul(to: Algebra, a: int, b: int, v: int) -> tuple[Factor | None, Factor | None]:
    return (_times(to.mul(to.two, a)), None) if a == b else (_times(b), _times(a))


def _div(to: Algebra, a: int, b: int, v: int) -> tuple[Factor | None, Factor | None]:
    inverse = _reciprocal(to, b)
    return _times(inverse), _times(to.neg(to.mul(v, inverse)))


def _pow(to: Algebra, a: int, b: int, v: int) -> tuple[Factor | None, Factor | None]:
    exponent = to.known(b)
    if exponent == 0.0:
        return None, None
    if exponent == 1.0:
        return _same, None
    if exponent == 2.0:
        return _times(to.mul(to.two, a)), None
    less = to.apply(Operator.POW, a, to.sub(b, to.one))
    by_second = None if exponent is not None else _times(to.mul(v, to.apply(Operator.LOG, a)))
    return _times(to.mul(b, less)), by_second


def _atan2(to: Algebra, a: int, b: int, v: int) -> tuple[Factor | None, Factor | None]:
    squares = to.add(_square(to, a), _square(to, b))
    return _times(to.div(b, squares)), _times(to.neg(to.div(a, squares)))


def _least(to: Algebra, a: int, b: int, v: int) -> tuple[Factor | None, Factor | None]:
    return _either(to, to.apply(Operator.LE, a, b))


def _largest(to: Algebra, a: int, b: int, v: int) -> tuple[Factor | None, Factor | None]:
    return _either(to, to.apply(Operator.LE, b, a))


def _either(to: Algebra, first: int) -> tuple[Factor | None, Factor | None]:
    return _where(first), _where(to.apply(Operator.NOT, first))


def _chosen(to: Algebra, a: int, b: int, v: int) -> tuple[Factor | None, Factor | None]:
    return None, _where(a)


_BINARY: Mapping[Operator, Callable[[Algebra, int, int, int], tuple[Factor | None, Factor | None]]] = {
    Operator.ADD: _add,
    Operator.SUB: _sub,
    Operator.MUL: _mul,
    Operator.DIV: _div,
    Operator.POW: _pow,
    Operator.ATAN2: _atan2,
    Operator.MIN: _least,
    Operator.MAX: _largest,
    Operator.CHOOSE: _chosen,
}
