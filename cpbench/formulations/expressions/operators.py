"""The operators that a nonlinear function may have: what nothing else is evaluated or read from a file."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Any

import numpy as np


class Operator(IntEnum):
    """Numbers of the operators of a tape; those from `ADD` on take two arguments."""

    NEG = 0
    ABS = 1
    SQRT = 2
    EXP = 3
    LOG = 4
    EXPM1 = 5
    LOG1P = 6
    SIN = 7
    COS = 8
    TAN = 9
    ASIN = 10
    ACOS = 11
    ATAN = 12
    SINH = 13
    COSH = 14
    TANH = 15
    ASINH = 16
    ACOSH = 17
    ATANH = 18
    ERF = 19
    FLOOR = 20
    CEIL = 21
    NOT = 22
    ADD = 32
    SUB = 33
    MUL = 34
    DIV = 35
    POW = 36
    ATAN2 = 37
    MIN = 38
    MAX = 39
    LT = 40
    LE = 41
    EQ = 42
    AND = 43
    OR = 44
    CHOOSE = 45
    """b where a is true (not 0), else 0; b is not looked at there, so it may be no number."""

    @property
    def binary(self) -> bool:
        return self >= Operator.ADD


def _truth(value: Any) -> Any:
    return np.asarray(value, dtype=float)


def _erf(x: Any) -> Any:
    try:
        from scipy.special import erf
    except ImportError:  # the interpreter of a guest may have NumPy alone
        erf = np.vectorize(math.erf, otypes=[float])
    return erf(x)


NUMPY: Mapping[Operator, Callable[..., Any]] = {
    Operator.NEG: np.negative,
    Operator.ABS: np.abs,
    Operator.SQRT: np.sqrt,
    Operator.EXP: np.exp,
    Operator.LOG: np.log,
    Operator.EXPM1: np.expm1,
    Operator.LOG1P: np.log1p,
    Operator.SIN: np.sin,
    Operator.COS: np.cos,
    Operator.TAN: np.tan,
    Operator.ASIN: np.arcsin,
    Operator.ACOS: np.arccos,
    Operator.ATAN: np.arctan,
    Operator.SINH: np.sinh,
    Operator.COSH: np.cosh,
    Operator.TANH: np.tanh,
    Operator.ASINH: np.arcsinh,
    Operator.ACOSH: np.arccosh,
    Operator.ATANH: np.arctanh,
    Operator.ERF: _erf,
    Operator.FLOOR: np.floor,
    Operator.CEIL: np.ceil,
    Operator.NOT: lambda a: _truth(a == 0),
    Operator.ADD: np.add,
    Operator.SUB: np.subtract,
    Operator.MUL: np.multiply,
    Operator.DIV: np.divide,
    Operator.POW: np.power,
    Operator.ATAN2: np.arctan2,
    Operator.MIN: np.fmin,
    Operator.MAX: np.fmax,
    Operator.LT: lambda a, b: _truth(a < b),
    Operator.LE: lambda a, b: _truth(a <= b),
    Operator.EQ: lambda a, b: _truth(a == b),
    Operator.AND: lambda a, b: _truth((a != 0) & (b != 0)),
    Operator.OR: lambda a, b: _truth((a != 0) | (b != 0)),
    Operator.CHOOSE: lambda a, b: np.where(a != 0, b, 0.0),
}
"""The value of every operator, elementwise: the definition that CasADi's evaluation is tested against."""
