"""Maps out of other maps and formulas of NumPy columns: what conversions and planted problems are written in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from cpbench.formulations.expressions.algebra import Algebra
from cpbench.formulations.expressions.derivatives import gradient
from cpbench.formulations.expressions.map import Builder, Map
from cpbench.formulations.expressions.operators import NUMPY, Operator
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix


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


Column: TypeAlias = Any
"""An array of symbols and numbers (dtype object), or one of them."""


class MapRecorder:
    """A map in the making. z : the column of its unknowns."""

    def __init__(self, inputs: int) -> None:
        self._to = Algebra(inputs)
        self.z: Column = self._column(range(inputs))

    def __call__(self, F: Map, z: Column) -> Column:
        """Evaluate F(z)."""
        values = self._to.values(F, self._numbers(z))
        return self._column(values[end] for end in F.outputs.tolist())

    def transposed(self, F: Map, z: Column, weights: Column) -> Column:
        """Evaluate F′(z)ᵀ weights."""
        partials = gradient(self._to, F, self._numbers(z), self._numbers(weights))
        return self._column(partials.get(k, self._to.zero) for k in range(F.inputs))

    def map(self, *outputs: Column) -> Map:
        """Return the map from z to the outputs, one after the other, each row by row."""
        return self._to.finish([number for output in outputs for number in self._numbers(np.ravel(output))])

    def _column(self, numbers: Any) -> Column:
        symbols = [Symbol(self._to, number) for number in numbers]
        column = np.empty(len(symbols), dtype=object)
        column[:] = symbols
        return column

    def _numbers(self, column: Column) -> list[int]:
        return [x.number if isinstance(x, Symbol) else self._to.constant(x) for x in np.ravel(column).tolist()]


def recorded(inputs: int, formula: Callable[[Column], Column]) -> Map:
    """Record the map that a formula of its column of unknowns computes.

    >>> recorded(2, lambda z: np.array([[2.0, 0.0], [0.0, 1.0]]) @ z + np.exp(z))(np.array([0.0, 0.0])).tolist()
    [1.0, 1.0]
    """
    record = MapRecorder(inputs)
    return record.map(formula(record.z))


def product(M: Matrix, z: Column) -> Column:
    """Multiply Mz, of what is stored in M only."""
    S = matrices.sparse(M)
    result = np.full(S.shape[0], 0.0 * z[0] if len(z) else 0.0, dtype=object)
    columns, data, ends = S.indices.tolist(), S.data.tolist(), S.indptr.tolist()
    for row in range(S.shape[0]):
        for k in range(ends[row], ends[row + 1]):
            result[row] = data[k] * z[columns[k]] + result[row]
    return result


def _applied(operator: Operator) -> Callable[[Any, Any], Any]:
    def apply(a: Any, b: Any) -> Any:
        if isinstance(a, Symbol):
            return a.apply(operator, b)
        if isinstance(b, Symbol):
            return Symbol(b.build, b.build.constant(a)).apply(operator, b)
        return float(NUMPY[operator](a, b))

    return np.frompyfunc(apply, 2, 1)


minimum = _applied(Operator.MIN)
"""The smaller of two columns, the first one where they are equal."""
maximum = _applied(Operator.MAX)
"""The larger of two columns, the first one where they are equal."""
less = _applied(Operator.LT)
"""Where one column is smaller than another: NumPy's own signs would ask for a truth that is not known yet."""
where = _applied(Operator.CHOOSE)
"""The second column where the first, a condition, is true; 0 elsewhere, whatever the second may be there."""


def either(condition: Column, one: Column, other: Column) -> Column:
    """Return `one` where the condition is true, else `other`."""
    return where(condition, one) + where(_not(condition), other)


_not = np.frompyfunc(lambda a: a.apply(Operator.NOT) if isinstance(a, Symbol) else float(not a), 1, 1)
