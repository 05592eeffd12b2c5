"""Nonlinear maps in balls: values, and derivatives by the chain rule in forward mode.

A comparison that the balls leave open, or a kink within them, gives what is not finite: such a box proves nothing.
Arithmetic operators take exact rationals as well, and stay exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from flint import arb, fmpq

from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.operators import Operator as Op
from cpbench.foundation.matrices import Dense
from cpbench_lab.certificates.contact_balls import pair
from cpbench_lab.certificates.krawczyk import digits

DERIVATIVE_BITS = 80
"""Bits of derivatives: they are rounded to doubles afterwards."""


def values(F: Map, x: Sequence[Any]) -> list[Any]:
    """Return F(x) in balls."""
    known = _constants(F, x, arb)
    for head, a, b in _operations(F):
        known.append(_VALUES[Op(head)](known[a], known[b]) if b >= 0 else _VALUES[Op(head)](known[a], None))
    return [known[k] for k in F.outputs.tolist()]


def exact_values(F: Map, x: Sequence[Any]) -> list[Any] | None:
    """Return F(x) over the rationals; None where an operation leaves them."""
    known = _constants(F, x, lambda v: fmpq(*v.as_integer_ratio()))
    for head, a, b in _operations(F):
        found = _rational(Op(head), known[a], known[b] if b >= 0 else None)
        if found is None:
            return None
        known.append(found)
    return [known[k] for k in F.outputs.tolist()]


def jacobian(F: Map, x: Sequence[Any], columns: Sequence[int]) -> tuple[Dense, Dense]:
    """Centres and radii of ∂F/∂x over a box of balls, for some of the unknowns."""
    centre, spread = np.zeros((F.rows, len(columns))), np.zeros((F.rows, len(columns)))
    with digits(DERIVATIVE_BITS):
        for i, row in enumerate(slopes(F, x, columns)):
            for j, slope in row.items():
                centre[i, j], spread[i, j] = pair(slope)
    return centre, spread


def slopes(F: Map, x: Sequence[Any], columns: Sequence[int]) -> list[dict[int, Any]]:
    """Rows of ∂F/∂x in balls, by places in `columns`; what is missing is 0."""
    known = _constants(F, x, arb)
    place = {j: k for k, j in enumerate(columns)}
    found: list[dict[int, Any]] = [{place[j]: arb(1)} if j in place else {} for j in range(F.inputs)]
    found += [{} for _ in range(F.constants.size)]
    for head, a, b in _operations(F):
        operator, left, right = Op(head), known[a], known[b] if b >= 0 else None
        known.append(_VALUES[operator](left, right))
        own: dict[int, Any] = {}
        moving = found[a] or (found[b] if b >= 0 else {})
        by_left, by_right = _slopes(operator, left, right, known[-1]) if moving else (None, None)
        for by, source in ((by_left, a), (by_right, b)):
            if by is not None and not (by.is_finite() and by == 0):
                for j, slope in found[source].items():
                    own[j] = own[j] + by * slope if j in own else by * slope
        found.append(own)
    return [found[k] for k in F.outputs.tolist()]


def _operations(F: Map) -> list[tuple[int, int, int]]:
    return list(zip(F.heads.tolist(), F.left.tolist(), F.right.tolist(), strict=True))


def _constants(F: Map, x: Sequence[Any], number: Callable[[float], Any]) -> list[Any]:
    return [*x, *map(number, F.constants.tolist())]


def _unknown() -> Any:
    return arb("nan")


def _choice(test: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Return 1 where a comparison is certain, 0 where its contrary is, else no number."""

    def decided(a: Any, b: Any) -> Any:
        found = test(a, b)
        return _unknown() if found is None else arb(1 if found else 0)

    return decided


def _less(a: Any, b: Any) -> bool | None:
    return True if a < b else False if a >= b else None


def _at_most(a: Any, b: Any) -> bool | None:
    return True if a <= b else False if a > b else None


def _equal(a: Any, b: Any) -> bool | None:
    return True if a.is_exact() and b.is_exact() and a == b else False if a < b or a > b else None


def _true(a: Any) -> bool | None:
    return False if a.is_zero() else True if a < 0 or a > 0 else None


def _both(a: Any, b: Any) -> bool | None:
    one, other = _true(a), _true(b)
    return False if one is False or other is False else None if one is None or other is None else True


def _either(a: Any, b: Any) -> bool | None:
    one, other = _true(a), _true(b)
    return True if one or other else None if one is None or other is None else False


def _chosen(a: Any, b: Any) -> Any:
    truth = _true(a)
    return _unknown() if truth is None else b if truth else arb(0)


def _whole(a: Any) -> int | None:
    """Return the integer that an exact ball is, None where it is none."""
    return int(a.unique_fmpz()) if a.is_exact() and a.is_integer() and abs(a) < 100 else None


def _power(a: Any, b: Any) -> Any:
    n = _whole(b)
    if n is not None and (n >= 0 or not a.contains(0)):
        # by products: FLINT's power takes the logarithm of a ball that holds 0
        power = math.prod([a] * abs(n), start=arb(1))
        return power if n >= 0 else 1 / power
    return a**b if a > 0 else _unknown()


_VALUES: Mapping[Op, Callable[[Any, Any], Any]] = {
    Op.NEG: lambda a, _: -a,
    Op.ABS: lambda a, _: abs(a),
    Op.SQRT: lambda a, _: a.sqrt() if a >= 0 else _unknown(),
    Op.EXP: lambda a, _: a.exp(),
    Op.LOG: lambda a, _: a.log() if a > 0 else _unknown(),
    Op.EXPM1: lambda a, _: a.expm1(),
    Op.LOG1P: lambda a, _: (1 + a).log() if a > -1 else _unknown(),
    Op.SIN: lambda a, _: a.sin(),
    Op.COS: lambda a, _: a.cos(),
    Op.TAN: lambda a, _: a.tan(),
    Op.ASIN: lambda a, _: a.asin(),
    Op.ACOS: lambda a, _: a.acos(),
    Op.ATAN: lambda a, _: a.atan(),
    Op.SINH: lambda a, _: a.sinh(),
    Op.COSH: lambda a, _: a.cosh(),
    Op.TANH: lambda a, _: a.tanh(),
    Op.ASINH: lambda a, _: a.asinh(),
    Op.ACOSH: lambda a, _: a.acosh(),
    Op.ATANH: lambda a, _: a.atanh(),
    Op.ERF: lambda a, _: a.erf(),
    Op.FLOOR: lambda a, _: a.floor(),
    Op.CEIL: lambda a, _: a.ceil(),
    Op.NOT: _choice(lambda a, _: None if (truth := _true(a)) is None else not truth),
    Op.ADD: lambda a, b: a + b,
    Op.SUB: lambda a, b: a - b,
    Op.MUL: lambda a, b: a * b,
    Op.DIV: lambda a, b: a / b if not b.contains(0) else _unknown(),
    Op.POW: _power,
    Op.ATAN2: lambda a, b: arb.atan2(a, b) if b > 0 or a < 0 or a > 0 else _unknown(),
    Op.MIN: lambda a, b: a.min(b),
    Op.MAX: lambda a, b: a.max(b),
    Op.LT: _choice(_less),
    Op.LE: _choice(_at_most),
    Op.EQ: _choice(_equal),
    Op.AND: _choice(_both),
    Op.OR: _choice(_either),
    Op.CHOOSE: _chosen,
}
_STEPS = (Op.FLOOR, Op.CEIL, Op.NOT, Op.LT, Op.LE, Op.EQ, Op.AND, Op.OR)
"""Operators that are constant between their jumps."""
_SMOOTH: Mapping[Op, Callable[[Any, Any], Any]] = {
    Op.NEG: lambda a, f: arb(-1),
    Op.SQRT: lambda a, f: 1 / (2 * f) if a > 0 else _unknown(),
    Op.EXP: lambda a, f: f,
    Op.LOG: lambda a, f: 1 / a,
    Op.EXPM1: lambda a, f: a.exp(),
    Op.LOG1P: lambda a, f: 1 / (1 + a),
    Op.SIN: lambda a, f: a.cos(),
    Op.COS: lambda a, f: -a.sin(),
    Op.TAN: lambda a, f: 1 + f * f,
    Op.ASIN: lambda a, f: 1 / (1 - a * a).sqrt(),
    Op.ACOS: lambda a, f: -1 / (1 - a * a).sqrt(),
    Op.ATAN: lambda a, f: 1 / (1 + a * a),
    Op.SINH: lambda a, f: a.cosh(),
    Op.COSH: lambda a, f: a.sinh(),
    Op.TANH: lambda a, f: 1 - f * f,
    Op.ASINH: lambda a, f: 1 / (1 + a * a).sqrt(),
    Op.ACOSH: lambda a, f: 1 / (a * a - 1).sqrt(),
    Op.ATANH: lambda a, f: 1 / (1 - a * a),
    Op.ERF: lambda a, f: 2 / arb.pi().sqrt() * (-a * a).exp(),
    Op.ABS: lambda a, f: arb(1) if a > 0 else arb(-1) if a < 0 else _unknown(),
}


def _slopes(op: Op, a: Any, b: Any, f: Any) -> tuple[Any, Any]:
    """Return ∂f/∂a and ∂f/∂b, None where f does not depend on an argument."""
    if op in _SMOOTH:
        return _SMOOTH[op](a, f), None
    if op in _STEPS:  # a jump within the box leaves the value open
        inside = arb(0) if f.is_exact() else _unknown()
        return inside, inside if b is not None else None
    if op is Op.ADD:
        return arb(1), arb(1)
    if op is Op.SUB:
        return arb(1), arb(-1)
    if op is Op.MUL:
        return b, a
    if op is Op.DIV:
        return 1 / b, -f / b
    if op is Op.POW:
        n = _whole(b)
        by_base = b * _power(a, b - 1) if n != 0 else arb(0)
        return by_base, f * a.log() if n is None and a > 0 else None if n is not None else _unknown()
    if op is Op.ATAN2:
        square = a * a + b * b
        return b / square, -a / square
    if op is Op.CHOOSE:
        truth = _true(a)
        by = _unknown() if truth is None else arb(1 if truth else 0)
        return None if truth is not None else by, by
    first = _less(a, b)  # the smaller of MIN, the larger of MAX
    if first is None:
        return _unknown(), _unknown()
    return (arb(1), arb(0)) if first == (op is Op.MIN) else (arb(0), arb(1))


def _rational(op: Op, a: Any, b: Any) -> Any:
    """Return an operation on rationals, None where it leaves them."""
    if op is Op.NEG:
        return -a
    if op is Op.ABS:
        return abs(a)
    if op in (Op.ADD, Op.SUB, Op.MUL, Op.MIN, Op.MAX):
        return {Op.ADD: a + b, Op.SUB: a - b, Op.MUL: a * b, Op.MIN: min(a, b), Op.MAX: max(a, b)}[op]
    if op is Op.DIV:
        return a / b if b != 0 else None
    if op is Op.POW and b.q == 1 and abs(b) < 1000 and (b >= 0 or a != 0):
        return a ** int(b.p)
    if op is Op.EXP and a == 0:
        return fmpq(1)
    return None
