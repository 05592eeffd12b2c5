"""Affine and quadratic functions among the values of a map that is being built.

A value is read as a sum of terms with signs, each a number, c·zᵢ or c·zᵢzⱼ, as it was written: nothing is multiplied
out, and no two numbers are combined, so that every coefficient is a number of the file, or twice one.
"""

from __future__ import annotations

import math

from cpbench.expressions.from_mof import Affine, Quadratic
from cpbench.expressions.map import Builder
from cpbench.expressions.operators import Operator


class PlainRows:
    """The values of `build`, taken apart."""

    def __init__(self, build: Builder) -> None:
        self._build = build

    def summands(self, value: int) -> list[tuple[float, int]]:
        """Return (1 or -1, value) of the terms of a sum, in their order."""
        found: list[tuple[float, int]] = []
        operation = self._build.operation(value)
        while operation is not None and operation[0] in (Operator.ADD, Operator.SUB):
            head, left, right = operation
            found.append((1.0 if head == Operator.ADD else -1.0, right))
            value, operation = left, self._build.operation(left)
        if operation is not None and operation[0] == Operator.NEG:
            found.append((-1.0, operation[1]))
        else:
            found.append((1.0, value))
        return found[::-1]

    def function(self, value: int) -> Affine | Quadratic | None:
        """Return the function that a value is, None where it is neither affine nor quadratic, or has two constants."""
        products: list[tuple[int, int, float]] = []
        affine = Affine([], [], 0.0)
        constants = 0
        for sign, term in self.summands(value):
            factor, what = self._factor(term)
            if what is None:
                return None
            if what < 0:
                affine.constant = sign * factor
                constants += 1
            elif what < self._build.inputs:
                affine.columns.append(what)
                affine.values.append(sign * factor)
            else:
                operation = self._build.operation(what)
                assert operation is not None  # a product, says `_factor`
                _, i, j = operation
                products.append((i, j, sign * factor if i != j else 2.0 * sign * factor))
                if not math.isfinite(products[-1][2]):
                    return None
        if constants > 1:
            return None
        if affine.constant == 0.0 and math.copysign(1.0, affine.constant) < 0:
            return None  # a side of a set has no room for the sign of a zero
        return Quadratic(products, affine) if products else affine

    def _factor(self, value: int) -> tuple[float, int | None]:
        """Return (c, x) of c·x, x the number of a variable or of a product of two; -1: the number c itself; None:
        neither.
        """
        build = self._build
        alone = build.number(value)
        if alone is not None:
            return alone, -1
        operation, factor = build.operation(value), 1.0
        if operation is not None and operation[0] == Operator.MUL:
            for number, other in ((operation[1], operation[2]), (operation[2], operation[1])):
                coefficient = build.number(number)
                if coefficient is not None:
                    factor, value, operation = coefficient, other, build.operation(other)
                    break
        single = value < build.inputs
        product = operation is not None and operation[0] == Operator.MUL and max(operation[1:]) < build.inputs
        return factor, value if single or product else None
