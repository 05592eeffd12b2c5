"""Derivatives of a map as maps: lists of operations like any other, made once and evaluated at every z.

They are made in reverse mode, a row at a time: what every value does to it (Griewank and Walther, Evaluating
Derivatives, 2008, chapter 3). The pattern is what the list says, so it is the same for every z.

At a corner one of the one-sided derivatives or their mean is taken, always the same: |x| has 0 at 0, min and max are
their first argument where both are equal. Steps have the derivative 0, also where they jump.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Mapping, Sequence
from typing import TypeAlias

import numpy as np

from cpbench.formulations.expressions.algebra import Algebra
from cpbench.formulations.expressions.map import Index, Map
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


Row = dict[int, int]
"""Column of an entry that is not 0 for all z -> the number of its value."""
_OPERATORS: Mapping[int, Operator] = {int(operator): operator for operator in Operator}


def derivative(F: Map) -> tuple[Map, Index, Index]:
    """Return the map to the entries of F′ as a CSR, row by row, and its `indices` and `indptr`."""
    to = Algebra(F.inputs)
    return _entries(to, jacobian(to, F, list(range(F.inputs))))


def second_derivative(F: Map) -> tuple[Map, Index, Index]:
    """Return the map from (z, w) to the entries of ∇² wᵀF(z), as `derivative`; symmetric to the last bit."""
    n = F.inputs
    first = Algebra(n + F.rows)
    slopes = gradient(first, F, list(range(n)), list(range(n, n + F.rows)))
    moving = sorted(slopes)
    G = first.finish([slopes[column] for column in moving])
    to = Algebra(n + F.rows)
    rows: list[Row] = [{} for _ in range(n)]
    for i, row in zip(moving, jacobian(to, G, list(range(n + F.rows))), strict=True):
        for j, number in row.items():
            # one operation for both halves: rounding would make two of them differ
            if j < n and (i >= j or i not in rows[j]):
                rows[i][j] = rows[j][i] = number
    return _entries(to, rows)


def has_constant_curvature(F: Map) -> bool:
    """Return whether the second derivatives of F are written without z."""
    entries, _, _ = second_derivative(F)
    used = np.concatenate([entries.left, entries.right, entries.outputs])
    return not ((used >= 0) & (used < F.inputs)).any()


def gradient(to: Algebra, F: Map, inputs: list[int], weights: list[int]) -> Row:
    """Return the entries of F′ᵀw as operations of `to`; z and w are the values of the numbers `inputs` and
    `weights`.
    """
    return _Differentiated(to, F, inputs).backward(dict(_summed(to, F.outputs.tolist(), weights)))


def jacobian(to: Algebra, F: Map, inputs: list[int]) -> list[Row]:
    """Return the rows of F′ as operations of `to`; z are the values of the numbers `inputs`."""
    work = _Differentiated(to, F, inputs)
    return [work.backward({end: to.one}) for end in F.outputs.tolist()]


def _summed(to: Algebra, positions: list[int], terms: list[int]) -> Row:
    result: Row = {}
    for index, term in zip(positions, terms, strict=True):
        result[index] = to.add(result[index], term) if index in result else term
    return result


class _Differentiated:
    """A map within an algebra. Derivatives by inputs have the inputs' indices."""

    def __init__(self, to: Algebra, F: Map, inputs: list[int]) -> None:
        self._to, self._F = to, F
        self._first = F.inputs + F.constants.size
        self._left, self._right = F.left.tolist(), F.right.tolist()
        number = to.values(F, inputs)
        moves = _moves(F)
        self._factors = [
            partials(to, _OPERATORS[head], number[a], number[b] if b >= 0 else -1, number[self._first + k])
            if moves[self._first + k]
            else (None, None)
            for k, (head, a, b) in enumerate(zip(F.heads.tolist(), self._left, self._right, strict=True))
        ]
        self._moves = moves

    def backward(self, adjoint: Row) -> Row:
        """Return the derivatives of a sum of values, whose weights are `adjoint`."""
        to, first, moves = self._to, self._first, self._moves
        # largest number first: by then all users of a value have added to its weight, since they come after it
        waiting = [-value for value in adjoint]
        heapq.heapify(waiting)
        result: Row = {}
        while waiting:
            value = -heapq.heappop(waiting)
            weight = adjoint[value]
            # only where unknowns are reached: most of a list may be arithmetic of constants
            if weight == to.zero or not moves[value]:
                continue
            if value < self._F.inputs:
                result[value] = weight
                continue
            k = value - first
            for factor, inner in zip(self._factors[k], (self._left[k], self._right[k]), strict=True):
                if factor is None or not moves[inner]:
                    continue
                part = factor(to, weight)
                if inner in adjoint:
                    adjoint[inner] = to.add(adjoint[inner], part)
                else:
                    adjoint[inner] = part
                    heapq.heappush(waiting, -inner)
        return result


def _moves(F: Map) -> list[bool]:
    """Return for every value whether it depends on an unknown."""
    moves = [True] * F.inputs + [False] * F.constants.size
    for a, b in zip(F.left.tolist(), F.right.tolist(), strict=True):
        moves.append(moves[a] or (b >= 0 and moves[b]))
    return moves


def _entries(to: Algebra, rows: Sequence[Row]) -> tuple[Map, Index, Index]:
    ordered = [sorted(row.items()) for row in rows]
    indices = np.array([column for row in ordered for column, _ in row], dtype=np.int64)
    indptr = np.concatenate([[0], np.cumsum([len(row) for row in ordered], dtype=np.int64)])
    return to.finish([number for row in ordered for _, number in row]), indices, indptr.astype(np.int64)
