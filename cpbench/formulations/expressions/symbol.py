"""Maps written as formulas: one value, and what Python's signs and NumPy's functions make of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.formulations.expressions.algebra import Algebra
from cpbench.formulations.expressions.map import Builder
from cpbench.formulations.expressions.operators import Operator


class Symbol:
    """A value of a map that is being built: computes with other values of it and with numbers.

    Its methods have the names by which NumPy calls them: the same formula goes for columns of numbers and of symbols.
    """

    __slots__ = ("build", "number")

    def __init__(self, build: Builder | Algebra, number: int) -> None:
        self.build, self.number = build, number

    def apply(self, operator: Operator, *others: Any) -> Symbol:
        return Symbol(self.build, self.build.apply(operator, self.number, *(self._of(o).number for o in others)))

    def _of(self, value: Any) -> Symbol:
        return value if isinstance(value, Symbol) else Symbol(self.build, self.build.constant(value))

    def _with(self, operator: Operator, other: Any) -> Any:
        """Leave an operation to the column: NumPy goes through it."""
        return NotImplemented if isinstance(other, np.ndarray) else self.apply(operator, other)

    def __add__(self, other: Any) -> Any:
        return self._with(Operator.ADD, other)

    def __radd__(self, other: Any) -> Any:
        return self._of(other) + self

    def __sub__(self, other: Any) -> Any:
        return self._with(Operator.SUB, other)

    def __rsub__(self, other: Any) -> Any:
        return self._of(other) - self

    def __mul__(self, other: Any) -> Any:
        return self._with(Operator.MUL, other)

    def __rmul__(self, other: Any) -> Any:
        return self._of(other) * self

    def __truediv__(self, other: Any) -> Any:
        return self._with(Operator.DIV, other)

    def __rtruediv__(self, other: Any) -> Any:
        return self._of(other) / self

    def __neg__(self) -> Symbol:
        return self.apply(Operator.NEG)

    def __pow__(self, exponent: float) -> Symbol:
        """Raise to a power; whole ones from 2 on are products, which round alike everywhere and are defined below 0."""
        if exponent != int(exponent) or exponent < 2:
            return self.apply(Operator.POW, exponent)
        half = self if exponent < 4 else self ** (exponent // 2)
        return half * half if exponent % 2 == 0 else half * half * self

    def __bool__(self) -> bool:
        raise TypeError("the value of a symbol is not known yet: write `where` for what depends on it")

    def __abs__(self) -> Symbol:
        return self.apply(Operator.ABS)

    def sqrt(self) -> Symbol:
        return self.apply(Operator.SQRT)

    def exp(self) -> Symbol:
        return self.apply(Operator.EXP)

    def log(self) -> Symbol:
        return self.apply(Operator.LOG)

    def sin(self) -> Symbol:
        return self.apply(Operator.SIN)

    def cos(self) -> Symbol:
        return self.apply(Operator.COS)

    def tanh(self) -> Symbol:
        return self.apply(Operator.TANH)
