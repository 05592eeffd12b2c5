"""Linear systems in rational arithmetic: doubles are the fractions that they stand for."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from cpbench.foundation import matrices

Rational = list[Fraction]


def exact(M: Any) -> list[Rational]:
    """Return the rows of a matrix."""
    return [[Fraction(float(value)) for value in row] for row in matrices.dense(M)]


def solved(rows: Sequence[Rational], right: Rational) -> Rational | None:
    """Solve a square system by elimination; None where it is singular."""
    n = len(rows)
    table = [[*row, value] for row, value in zip(rows, right, strict=True)]
    for c in range(n):
        pivot = next((r for r in range(c, n) if table[r][c]), None)
        if pivot is None:
            return None
        table[c], table[pivot] = table[pivot], table[c]
        table[c] = [value / table[c][c] for value in table[c]]
        for r in range(n):
            if r != c and table[r][c]:
                table[r] = [a - table[r][c] * b for a, b in zip(table[r], table[c], strict=True)]
    return [row[n] for row in table]
