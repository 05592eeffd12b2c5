"""Operators of MathOptFormat's nonlinear functions, and what each is in operations of a map.

Only what is named here is read. The special functions but erf (gamma, besselj0, ...) and complex numbers are no
operators of a map; erfc(x) = 1 − erf(x) would lose its digits where x is large.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from cpbench.formulations.expressions.map import Builder
from cpbench.formulations.expressions.operators import Operator
from cpbench.formulations.expressions.recording import Symbol

UNARY: Mapping[str, Operator] = {
    "-": Operator.NEG,
    **{o.name.lower(): o for o in Operator if not o.binary and o not in (Operator.NEG, Operator.NOT)},
}
BINARY: Mapping[str, Operator] = {
    "/": Operator.DIV, "^": Operator.POW, "atan": Operator.ATAN2, "&&": Operator.AND, "||": Operator.OR,
    "<": Operator.LT, "<=": Operator.LE, "==": Operator.EQ,
}  # fmt: skip
MANY: Mapping[str, Operator] = {
    "+": Operator.ADD, "-": Operator.SUB, "*": Operator.MUL, "min": Operator.MIN, "max": Operator.MAX,
}  # fmt: skip
"""With any number of arguments, from the left: a − b − c = (a − b) − c."""
CHAINED = frozenset({Operator.ADD, Operator.MUL, Operator.MIN, Operator.MAX})
"""Written with all the arguments of a chain; SUB is not, as readers may know it with two only."""
WRITTEN: Mapping[Operator, str] = {o: name for table in (UNARY, BINARY, MANY) for name, o in table.items()}
"""Name of each operation in files; NOT a is ifelse(a, 0, 1) and CHOOSE(a, b) is ifelse(a, b, 0)."""


def _constant(x: Symbol, value: float) -> Symbol:
    return Symbol(x.build, x.build.constant(value))


def _signed(x: Symbol, size: Symbol) -> Symbol:
    """Return `size` with the sign of x, 0 where that is 0."""
    above, below = _constant(x, 0.0).apply(Operator.LT, x), x.apply(Operator.LT, 0.0)
    return above.apply(Operator.CHOOSE, size) - below.apply(Operator.CHOOSE, size)


def _choice(condition: Symbol, yes: Symbol, no: Symbol) -> Symbol:
    """Return ifelse in as few operations as there are; what NOT and CHOOSE are written as becomes these again."""
    zero = _constant(no, 0.0).number
    if no.number == zero:
        return condition.apply(Operator.CHOOSE, yes)
    otherwise = condition.apply(Operator.NOT)
    if yes.number == zero and no.number == _constant(no, 1.0).number:
        return otherwise
    return condition.apply(Operator.CHOOSE, yes) + otherwise.apply(Operator.CHOOSE, no)


_LN2, _LN10, _DEGREE = math.log(2.0), math.log(10.0), math.pi / 180.0
_CIRCULAR = {"sec": Operator.COS, "csc": Operator.SIN, "cot": Operator.TAN}
_HYPERBOLIC = {"sech": Operator.COSH, "csch": Operator.SINH, "coth": Operator.TANH}
_ARCS = {"asec": Operator.ACOS, "acsc": Operator.ASIN, "acot": Operator.ATAN}
_AREAS = {"asech": Operator.ACOSH, "acsch": Operator.ASINH, "acoth": Operator.ATANH}


def _named(table: Mapping[str, Operator], suffix: str, formula: Callable[[Symbol, Operator], Symbol]) -> dict[str, Any]:
    """Return `formula` of an argument and an operator, for every name of a table."""
    return {f"{name}{suffix}": (1, lambda x, o=o: formula(x, o)) for name, o in table.items()}


_SINES = {name: UNARY[name] for name in ("sin", "cos", "tan")}
_ARCSINES = {name: UNARY[name] for name in ("asin", "acos", "atan")}
FORMULAS: Mapping[str, tuple[int, Callable[..., Symbol]]] = {
    "ifelse": (3, _choice),
    ">": (2, lambda a, b: b.apply(Operator.LT, a)),
    ">=": (2, lambda a, b: b.apply(Operator.LE, a)),
    "abs2": (1, lambda x: x * x),
    "inv": (1, lambda x: 1.0 / x),
    "cbrt": (1, lambda x: _signed(x, abs(x) ** (1.0 / 3.0))),
    "log2": (1, lambda x: x.apply(Operator.LOG) / _LN2),
    "log10": (1, lambda x: x.apply(Operator.LOG) / _LN10),
    "exp2": (1, lambda x: _constant(x, 2.0).apply(Operator.POW, x)),
    "deg2rad": (1, lambda x: x * _DEGREE),
    "rad2deg": (1, lambda x: x / _DEGREE),
    **_named(_CIRCULAR | _HYPERBOLIC, "", lambda x, o: 1.0 / x.apply(o)),
    **_named(_ARCS | _AREAS, "", lambda x, o: (1.0 / x).apply(o)),
    **_named(_SINES, "d", lambda x, o: (x * _DEGREE).apply(o)),
    **_named(_CIRCULAR, "d", lambda x, o: 1.0 / (x * _DEGREE).apply(o)),
    **_named(_ARCSINES, "d", lambda x, o: x.apply(o) / _DEGREE),
    **_named(_ARCS, "d", lambda x, o: (1.0 / x).apply(o) / _DEGREE),
}
"""The other operators: how many arguments, and what they are in those above. Those in degrees are right to rounding,
so that sind(180) is 1e-16."""
KNOWN = frozenset((*UNARY, *BINARY, *MANY, *FORMULAS))


def combine(build: Builder, head: str, arguments: list[int]) -> int | None:
    """Return the value of an operation, None where no operation has so many arguments."""
    count = len(arguments)
    if count == 1 and head in UNARY:
        return build.apply(UNARY[head], arguments[0])
    if count == 2 and head in BINARY:
        return build.apply(BINARY[head], *arguments)
    if count and head in MANY:
        total = arguments[0]
        for argument in arguments[1:]:
            total = build.apply(MANY[head], total, argument)
        return total
    if head in FORMULAS and count == FORMULAS[head][0]:
        return FORMULAS[head][1](*(Symbol(build, a) for a in arguments)).number
    return None
