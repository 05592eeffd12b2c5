"""Nonlinear maps as exact sums: F(z) = Σ coefficients · (1, z, what is not linear), over the rationals.

Rows that depend on each other as sums do so for every z: where some are 0, the others are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from flint import fmpq, fmpq_mat

from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.operators import Operator as Op
from cpbench_lab.certificates.exact_rows import Index, rational

LARGEST = 400
"""Rows of the largest set that is looked at."""


def dependent_rows(F: Map, rows: Sequence[int], held: dict[int, float]) -> Index:
    """Rows F = 0, of some, that the others imply exactly where some unknowns are held; as places in `rows`."""
    none = np.zeros(0, dtype=np.int64)
    if not 0 < len(rows) <= LARGEST:
        return none
    sums = [_combined(F, int(F.outputs[i]), held) for i in rows]
    terms = {term: k for k, term in enumerate(sorted({term for own in sums for term in own}))}
    table = fmpq_mat(len(terms), len(rows))
    for i, own in enumerate(sums):
        for term, value in own.items():
            table[terms[term], i] = value
    reduced: Any
    reduced, rank = table.rref()
    if rank == len(rows):
        return none
    kept, column = list[int](), 0
    for row in range(int(rank)):
        while reduced[row, column] == 0:
            column += 1
        kept.append(column)
        column += 1
    return np.setdiff1d(np.arange(len(rows)), kept)


def _combined(F: Map, output: int, held: dict[int, float]) -> dict[int, Any]:
    """Coefficients of an output by the numbers of values that are not sums, −1 for the constant."""
    first = F.inputs + F.constants.size
    found: dict[int, Any] = {}
    waiting: list[tuple[int, Any]] = [(output, fmpq(1))]
    for _ in range(20 * (F.operations + 1)):
        if not waiting:
            return {term: value for term, value in found.items() if value != 0}
        number, factor = waiting.pop()
        if number < first:
            fixed = held.get(number) if number < F.inputs else float(F.constants[number - F.inputs])
            term, value = (number, factor) if fixed is None else (-1, factor * rational(fixed))
            found[term] = found.get(term, fmpq(0)) + value
            continue
        k = number - first
        parts = _summands(F, Op(int(F.heads[k])), int(F.left[k]), int(F.right[k]), held)
        if parts is None:
            found[number] = found.get(number, fmpq(0)) + factor
        else:
            waiting += [(part, factor * own) for part, own in parts]
    return {output: fmpq(1)}  # sums that are shared too often: the output as a whole


def _summands(F: Map, op: Op, a: int, b: int, held: dict[int, float]) -> list[tuple[int, Any]] | None:
    """Values with factors that an operation adds up, None where it is not a sum."""
    if op is Op.ADD:
        return [(a, fmpq(1)), (b, fmpq(1))]
    if op is Op.SUB:
        return [(a, fmpq(1)), (b, fmpq(-1))]
    if op is Op.NEG:
        return [(a, fmpq(-1))]
    if op in (Op.MUL, Op.DIV):
        right = _known(F, b, held)
        if right is not None and (op is Op.MUL or right != 0):
            return [(a, right if op is Op.MUL else 1 / right)]
        left = _known(F, a, held) if op is Op.MUL else None
        if left is not None:
            return [(b, left)]
    return None


def _known(F: Map, number: int, held: dict[int, float]) -> Any:
    """Return the exact value of a constant or of an unknown that is held, None for others."""
    if number < F.inputs:
        return rational(held[number]) if number in held else None
    place = number - F.inputs
    return rational(float(F.constants[place])) if place < F.constants.size else None
