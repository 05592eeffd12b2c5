"""A map as CasADi expressions, which differentiate it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from cpbench.formulations.expressions.map import Map
from cpbench.formulations.expressions.operators import Operator


def express(F: Map, z: Any) -> Any:
    """Evaluate F(z) as an SX column; z an SX column of n rows."""
    import casadi as ca

    values: list[Any] = [*ca.vertsplit(z), *(ca.SX(c) for c in F.constants.tolist())] if F.inputs else []
    if not F.inputs:
        values = [ca.SX(c) for c in F.constants.tolist()]
    heads = _heads()
    for head, a, b in zip(F.heads.tolist(), F.left.tolist(), F.right.tolist(), strict=True):
        values.append(heads[head](values[a], values[b]) if b >= 0 else heads[head](values[a]))
    return ca.vertcat(*(values[k] for k in F.outputs.tolist())) if F.rows else ca.SX(0, 1)


def _heads() -> Mapping[int, Callable[..., Any]]:
    import casadi as ca

    return {
        Operator.NEG: lambda a: -a,
        Operator.ABS: ca.fabs,
        Operator.SQRT: ca.sqrt,
        Operator.EXP: ca.exp,
        Operator.LOG: ca.log,
        Operator.EXPM1: ca.expm1,
        Operator.LOG1P: ca.log1p,
        Operator.SIN: ca.sin,
        Operator.COS: ca.cos,
        Operator.TAN: ca.tan,
        Operator.ASIN: ca.asin,
        Operator.ACOS: ca.acos,
        Operator.ATAN: ca.atan,
        Operator.SINH: ca.sinh,
        Operator.COSH: ca.cosh,
        Operator.TANH: ca.tanh,
        Operator.ASINH: ca.asinh,
        Operator.ACOSH: ca.acosh,
        Operator.ATANH: ca.atanh,
        Operator.ERF: ca.erf,
        Operator.FLOOR: ca.floor,
        Operator.CEIL: ca.ceil,
        Operator.NOT: ca.logic_not,
        Operator.ADD: lambda a, b: a + b,
        Operator.SUB: lambda a, b: a - b,
        Operator.MUL: lambda a, b: a * b,
        Operator.DIV: lambda a, b: a / b,
        Operator.POW: lambda a, b: a**b,
        Operator.ATAN2: ca.atan2,
        Operator.MIN: ca.fmin,
        Operator.MAX: ca.fmax,
        Operator.LT: lambda a, b: a < b,
        Operator.LE: lambda a, b: a <= b,
        Operator.EQ: lambda a, b: a == b,
        Operator.AND: ca.logic_and,
        Operator.OR: ca.logic_or,
        Operator.CHOOSE: lambda a, b: ca.if_else(a, b, 0),
    }
