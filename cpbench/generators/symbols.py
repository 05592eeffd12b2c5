"""Formulas of the generators as maps: operation by operation, as they are written.

CasADi and SymPy simplify, each version in its own way; a map that ships must come out the same everywhere.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import Any

from cpbench import matrices
from cpbench.expressions import Builder, Map, Operator
from cpbench.matrices import Matrix


class Symbol:
    """A value of a map that is being built; +, −, ·, / and ** with other values of it and with numbers."""

    __slots__ = ("build", "number")

    def __init__(self, build: Builder, number: int) -> None:
        self.build, self.number = build, number

    def apply(self, operator: Operator, *others: Any) -> Symbol:
        return Symbol(self.build, self.build.apply(operator, self.number, *(self._of(o).number for o in others)))

    def _of(self, value: Any) -> Symbol:
        return value if isinstance(value, Symbol) else Symbol(self.build, self.build.constant(value))

    def __add__(self, other: Any) -> Symbol:
        return self.apply(Operator.ADD, other)

    def __radd__(self, other: Any) -> Symbol:
        return self._of(other) + self

    def __sub__(self, other: Any) -> Symbol:
        return self.apply(Operator.SUB, other)

    def __rsub__(self, other: Any) -> Symbol:
        return self._of(other) - self

    def __mul__(self, other: Any) -> Symbol:
        return self.apply(Operator.MUL, other)

    def __rmul__(self, other: Any) -> Symbol:
        return self._of(other) * self

    def __truediv__(self, other: Any) -> Symbol:
        return self.apply(Operator.DIV, other)

    def __rtruediv__(self, other: Any) -> Symbol:
        return self._of(other) / self

    def __neg__(self) -> Symbol:
        return self.apply(Operator.NEG)

    def __pow__(self, exponent: float) -> Symbol:
        """Whole powers from 2 on are products, which round alike everywhere and are defined below 0."""
        if exponent != int(exponent) or exponent < 2:
            return self.apply(Operator.POW, exponent)
        half = self if exponent < 4 else self ** (exponent // 2)
        return half * half if exponent % 2 == 0 else half * half * self


def unknowns(n: int) -> list[Symbol]:
    """z₁, …, z_n of a map to be."""
    build = Builder(n)
    return [Symbol(build, k) for k in range(n)]


def mapped(z: Sequence[Symbol], outputs: Sequence[Any]) -> Map:
    """The map from z, all that `unknowns` gave, to `outputs`, some of which may be numbers."""
    build = z[0].build
    return build.finish([o.number if isinstance(o, Symbol) else build.constant(o) for o in outputs])


def total(terms: Iterable[Any]) -> Any:
    """The sum, from the first to the last; 0.0 of nothing."""
    result: Any = None
    for term in terms:
        result = term if result is None else result + term
    return 0.0 if result is None else result


def product(M: Matrix, z: Sequence[Symbol]) -> list[Any]:
    """Mz, a row the sum of what is stored in it."""
    S = matrices.sparse(M)
    columns, data, ends = S.indices.tolist(), S.data.tolist(), S.indptr.tolist()
    return [total(_times(data[k], z[columns[k]]) for k in range(a, b)) for a, b in itertools.pairwise(ends)]


def _times(factor: float, z: Symbol) -> Symbol:
    return z if factor == 1.0 else factor * z


def exp(x: Symbol) -> Symbol:
    return x.apply(Operator.EXP)


def log(x: Symbol) -> Symbol:
    return x.apply(Operator.LOG)


def sqrt(x: Symbol) -> Symbol:
    return x.apply(Operator.SQRT)


def sin(x: Symbol) -> Symbol:
    return x.apply(Operator.SIN)


def cos(x: Symbol) -> Symbol:
    return x.apply(Operator.COS)


def atan(x: Symbol) -> Symbol:
    return x.apply(Operator.ATAN)
