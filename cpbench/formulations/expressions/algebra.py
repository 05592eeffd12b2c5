"""A builder of maps that leaves out what changes nothing: x + 0, 1·x, 0·x, and operations of constants alone."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.expressions.map import Builder, Map
from cpbench.formulations.expressions.operators import NUMPY, Operator

ADD, SUB, MUL, DIV, NEG, CHOOSE = (
    Operator.ADD, Operator.SUB, Operator.MUL, Operator.DIV, Operator.NEG, Operator.CHOOSE
)  # fmt: skip
_TRUTHS = frozenset({Operator.LT, Operator.LE, Operator.EQ, Operator.NOT, Operator.AND, Operator.OR})
"""Operators whose values are 0 and 1."""


class Algebra:
    """Operations on numbers of values, as in `Builder`; a derivative is mostly zeros and ones before this."""

    def __init__(self, inputs: int) -> None:
        self._build = Builder(inputs)
        self._value: dict[int, float] = {}
        self._truths: set[int] = set()
        self._negated: dict[int, int] = {}
        self.zero, self.one, self.two = self.constant(0.0), self.constant(1.0), self.constant(2.0)

    def constant(self, value: float) -> int:
        number = self._build.constant(value)
        self._value[number] = float(value)
        return number

    def known(self, number: int) -> float | None:
        """Return the value of a constant, None for anything else."""
        return self._value.get(number)

    def finish(self, outputs: list[int]) -> Map:
        return self._build.finish(outputs)

    def apply(self, operator: Operator, a: int, b: int = -1) -> int:
        value = self._value
        if a in value and (b < 0 or b in value):
            folded = self._folded(operator, a, b)
            if folded is not None:
                return folded
        simple = self._simple(operator, a, b) if operator in _RULES else None
        if simple is not None:
            return simple
        number = self._build.apply(operator, a, b)
        if operator in _TRUTHS:
            self._truths.add(number)
        elif operator == NEG:
            self._negated[number] = a
        return number

    def _folded(self, operator: Operator, a: int, b: int) -> int | None:
        """Fold an operation on constants into a constant; None where it is not finite, which no constant may be."""
        arguments = [self._value[a]] if b < 0 else [self._value[a], self._value[b]]
        with np.errstate(all="ignore"):
            result = float(NUMPY[operator](*arguments))
        return self.constant(result) if np.isfinite(result) else None

    def _simple(self, operator: Operator, a: int, b: int) -> int | None:
        left, right = self._value.get(a), self._value.get(b)
        if operator == NEG:
            return self._negated.get(a)
        if operator == ADD:
            if left == 0.0:
                return b
            return a if right == 0.0 else None
        if operator == SUB:
            if left == 0.0:
                return self.apply(NEG, b)
            return a if right == 0.0 else None
        if operator == MUL:
            return self._product(a, b, left, right)
        if operator == DIV:
            if left == 0.0:
                return self.zero
            return a if right == 1.0 else None
        if left is not None:  # CHOOSE
            return b if left else self.zero
        if right == 0.0:
            return self.zero
        return a if right == 1.0 and a in self._truths else None

    def _product(self, a: int, b: int, left: float | None, right: float | None) -> int | None:
        for factor, other in ((left, b), (right, a)):
            if factor == 0.0:
                return self.zero
            if factor == 1.0:
                return other
            if factor == -1.0:
                return self.apply(NEG, other)
        return None

    # ------------------------------------------------------------------------------------- in short

    def add(self, a: int, b: int) -> int:
        return self.apply(ADD, a, b)

    def sub(self, a: int, b: int) -> int:
        return self.apply(SUB, a, b)

    def mul(self, a: int, b: int) -> int:
        return self.apply(MUL, a, b)

    def div(self, a: int, b: int) -> int:
        return self.apply(DIV, a, b)

    def neg(self, a: int) -> int:
        return self.apply(NEG, a)

    def values(self, F: Map, inputs: list[int]) -> list[int]:
        """Add all operations of a map of these inputs, and return the number here of each of its values."""
        number = [*inputs, *(self.constant(c) for c in F.constants.tolist())]
        operators = {int(o): o for o in Operator}
        for head, a, b in zip(F.heads.tolist(), F.left.tolist(), F.right.tolist(), strict=True):
            number.append(self.apply(operators[head], number[a], number[b] if b >= 0 else -1))
        return number


_RULES = frozenset({ADD, SUB, MUL, DIV, NEG, CHOOSE})
