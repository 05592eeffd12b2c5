"""Affine and quadratic functions among the values of a map that is being built.

A value is read as a sum of terms with signs, each a number, c·zᵢ or c·zᵢzⱼ, as it was written: nothing is multiplied
out, and no two numbers are combined, so that every coefficient is a number of the file, or twice one.
"""

from __future__ import annotations

import math

from cpbench.formulations.expressions.map import Builder
from cpbench.formulations.expressions.operators import Operator
from cpbench_problems.formats.mof_functions import Affine, Quadratic


class PlainRows:
    """The values of `build`, taken apart."""

    def __init__(self, build: Builder) -> None:
        self._build = build

    def summands(self, value: int) -> list[tuple[float, int]]:
        """Return (1 or -1, value) of the terms of a sum, in their order."""
        terms: list[tuple[float, int]] = []
        operation = self._build.operation(value)
        while operation is not None and operation[0] in (Operator.ADD, Operator.SUB):
            head, left, right = operation
            terms.append((1.0 if head == Operator.ADD else -1.0, right))
            value, operation = left, self._build.operation(left)
        if operation is not None and operation[0] == Operator.NEG:
            terms.append((-1.0, operation[1]))
        else:
            terms.append((1.0, value))
        return terms[::-1]

    def function(self, value: int) -> Affine | Quadratic | None:
        """Return the function that a value is, None where it is neither affine nor quadratic, or has two constants."""
        products: list[tuple[int, int, float]] = []
        affine = Affine([], [], 0.0)
        constants = 0
        for sign, term in self.summands(value):
            factors = self._factors(term)
            if factors is None:
                return None
            factor, columns = factors
            if not columns:
                affine.constant = sign * factor
                constants += 1
            elif len(columns) == 1:
                affine.columns.append(columns[0])
                affine.values.append(sign * factor)
            else:
                i, j = columns
                products.append((i, j, sign * factor if i != j else 2.0 * sign * factor))
                if not math.isfinite(products[-1][2]):
                    return None
        if constants > 1:
            return None
        if affine.constant == 0.0 and math.copysign(1.0, affine.constant) < 0:
            return None  # a side of a set has no room for the sign of a zero
        return Quadratic(products, affine) if products else affine

    def _factors(self, value: int) -> tuple[float, list[int]] | None:
        """Return (c, variables) of a product of at most one number and two variables, None for any other value."""
        build = self._build
        numbers, columns, waiting = list[float](), list[int](), [value]
        while waiting and len(columns) <= 2 and len(numbers) <= 1:
            value = waiting.pop()
            number, operation = build.number(value), build.operation(value)
            if number is not None:
                numbers.append(number)
            elif value < build.inputs:
                columns.append(value)
            elif operation is not None and operation[0] == Operator.MUL:
                waiting += [operation[2], operation[1]]
            elif operation is not None and operation[0] == Operator.POW and build.number(operation[2]) == 2.0:
                waiting += [operation[1], operation[1]]
            else:
                return None
        fits = not waiting and len(columns) <= 2 and len(numbers) <= 1
        return (numbers[0] if numbers else 1.0, columns) if fits else None
