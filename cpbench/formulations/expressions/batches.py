"""Values of many terms of one form: equal operators of one depth are one NumPy call.

A discretized equation has one term a node of its grid, and all of them the same operations; then NumPy's exponentials
are several times faster than one after the other in machine code. Sums and products are not: gathering their arguments
costs more than they do, and is left to the interpreter.
At run time this needs NumPy alone: guests in another interpreter evaluate maps by it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from cpbench.formulations.expressions.operators import NUMPY, Operator

if TYPE_CHECKING:
    from cpbench.formulations.expressions.map import Map
    from cpbench.foundation.matrices import Vector

WORTHWHILE = 200
"""Slow operations that there must be for every call; a call costs about as much as so many in compiled code."""
_SLOW = [int(o) for o in Operator if Operator.EXP <= o <= Operator.ERF or o in (Operator.POW, Operator.ATAN2)]


class Batches:
    """z ↦ F(z) by one call for every depth and operator."""

    def __init__(self, F: Map) -> None:
        first = F.inputs + F.constants.size
        depth = _depths(F)
        order = np.lexsort((np.arange(F.operations), F.heads, depth))
        positions = np.concatenate([np.arange(first), np.empty(F.operations, dtype=np.int64), [-1]])
        positions[first + order] = first + np.arange(F.operations)
        ends = np.flatnonzero(np.diff(depth[order]) | np.diff(F.heads[order])) + 1
        bounds = [0, *ends.tolist(), F.operations] if F.operations else [0]
        self._inputs, self._constants, self._size = F.inputs, F.constants, first + F.operations
        self._outputs = _run(positions[F.outputs])
        self._slow = int(np.isin(F.heads, _SLOW).sum())
        self._calls: list[tuple[slice, Callable[..., Any], tuple[Any, ...]]] = []
        for a, b in itertools.pairwise(bounds):
            members = order[a:b]
            operator = Operator(int(F.heads[members[0]]))
            sides = (F.left, F.right) if operator.binary else (F.left,)
            arguments = tuple(_sliced(positions[side[members]]) for side in sides)
            self._calls.append((slice(first + a, first + b), NUMPY[operator], arguments))

    @property
    def worthwhile(self) -> bool:
        return 0 < WORTHWHILE * len(self._calls) <= self._slow

    def __call__(self, z: Vector) -> Vector:
        values = np.empty(self._size)
        values[: self._inputs] = z
        values[self._inputs : self._inputs + self._constants.size] = self._constants
        with np.errstate(all="ignore"):
            for span, function, arguments in self._calls:
                values[span] = function(*(values[a] for a in arguments))
        return values[self._outputs]


def _depths(F: Map) -> Any:
    """Return the depth of every operation: 1 + the largest of its arguments'."""
    first = F.inputs + F.constants.size
    depth = [0] * (first + F.operations + 1)  # the last one is for the argument that is not there
    for k, (a, b) in enumerate(zip(F.left.tolist(), F.right.tolist(), strict=True), first):
        depth[k] = 1 + max(depth[a], depth[b])
    return np.array(depth[first:-1], dtype=np.int64)


def _run(index: Any) -> Any:
    """Return a slice where the numbers follow each other, which costs no copy."""
    if index.size and (np.diff(index) == 1).all():
        return slice(int(index[0]), int(index[-1]) + 1)
    return index


def _sliced(index: Any) -> Any:
    """Return `_run`, or one number where all are the same, which goes with every other argument."""
    if index.size and (index == index[0]).all():
        return slice(int(index[0]), int(index[0]) + 1)
    return _run(index)
