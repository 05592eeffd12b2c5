"""Derivatives of a map as maps: lists of operations like any other, made once and evaluated at every z.

Forward: every value carries its derivatives by the unknowns that it hangs on. Reverse: a row at a time, what every
value does to it (Griewank and Walther, Evaluating Derivatives, 2008, chapters 3 and 7). The one that takes fewer steps
is taken. The pattern is what the list says, so it is the same for every z.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from cpbench.formulations.expressions.algebra import Algebra
from cpbench.formulations.expressions.map import Index, Map
from cpbench.formulations.expressions.operators import Operator
from cpbench.formulations.expressions.partials import partials

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
    if _forward_is_shorter(F):
        return work.forward()
    return [work.backward({end: to.one}) for end in F.outputs.tolist()]


def _summed(to: Algebra, places: list[int], terms: list[int]) -> Row:
    result: Row = {}
    for place, term in zip(places, terms, strict=True):
        result[place] = to.add(result[place], term) if place in result else term
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

    def forward(self) -> list[Row]:
        to = self._to
        slopes: list[Row] = [{k: to.one} for k in range(self._F.inputs)]
        slopes += [{} for _ in range(self._F.constants.size)]
        for (first, second), a, b in zip(self._factors, self._left, self._right, strict=True):
            row: Row = {}
            for factor, inner in ((first, a), (second, b)):
                if factor is None:
                    continue
                for column, number in slopes[inner].items():
                    part = factor(to, number)
                    row[column] = to.add(row[column], part) if column in row else part
            slopes.append({column: number for column, number in row.items() if number != to.zero})
        return [slopes[end] for end in self._F.outputs.tolist()]

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


def _forward_is_shorter(F: Map) -> bool:
    """Return whether forward mode is shorter; both are counted in turns until one of them is done."""
    forward, backward = _forward_steps(F), _backward_steps(F)
    # in turns, so that counting takes twice the shorter way at most: the other may be as long as all outputs times all
    # operations
    here = there = 0
    while True:
        if here <= there:
            step = next(forward, None)
            if step is None:
                return True
            here += step
        else:
            step = next(backward, None)
            if step is None:
                return False
            there += step


def _forward_steps(F: Map) -> Iterator[int]:
    reach: list[frozenset[int]] = [frozenset((k,)) for k in range(F.inputs)] + [frozenset()] * F.constants.size
    for a, b in zip(F.left.tolist(), F.right.tolist(), strict=True):
        reach.append(reach[a] | reach[b] if b >= 0 else reach[a])
        yield 1 + len(reach[-1])


def _backward_steps(F: Map) -> Iterator[int]:
    first, left, right = F.inputs + F.constants.size, F.left.tolist(), F.right.tolist()
    for end in F.outputs.tolist():
        seen, stack = {end}, [end]
        while stack:
            k = stack.pop() - first
            if k < 0:
                continue
            yield 2
            for inner in (left[k], right[k]):
                if inner >= 0 and inner not in seen:
                    seen.add(inner)
                    stack.append(inner)


def _entries(to: Algebra, rows: Sequence[Row]) -> tuple[Map, Index, Index]:
    ordered = [sorted(row.items()) for row in rows]
    indices = np.array([column for row in ordered for column, _ in row], dtype=np.int64)
    indptr = np.concatenate([[0], np.cumsum([len(row) for row in ordered], dtype=np.int64)])
    return to.finish([number for row in ordered for _, number in row]), indices, indptr.astype(np.int64)
