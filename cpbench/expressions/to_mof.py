"""Maps as functions of MathOptFormat, which read back as the same list of operations.

What is used once stands inside what uses it, as in a formula; what is used again, or would nest deeper than DEPTH, is
an entry of `node_list` after those it refers to. A chain of sums, products, minima or maxima has its terms in one
list. No root is a bare variable or number but +(x): so JuMP writes and wants it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from cpbench.expressions.from_mof import Affine, Functions, Quadratic
from cpbench.expressions.map import Map
from cpbench.expressions.mof_operators import CHAINED, WRITTEN
from cpbench.expressions.operators import Operator

DEPTH = 12
"""Terms inside each other: parsers of JSON and readers of people go that deep without trouble."""
REPEATED = 2
"""How often, on average, an operation may be written when every row is a function of its own."""
Term = Any


def vector(F: Map, names: Sequence[str]) -> dict[str, Any]:
    """Write F as one VectorNonlinearFunction of the variables `names`."""
    rows, nodes = _Writer(F, names).written(range(F.operations), F.outputs.tolist())
    return {"type": "VectorNonlinearFunction", "rows": rows, "node_list": nodes}


def scalars(F: Map, names: Sequence[str]) -> list[dict[str, Any]] | None:
    """Write F as one function a row: affine or quadratic where that reads back as the same operations, else nonlinear.

    None where rows share so much that this would be far longer than F is.
    """
    writer, plain = _Writer(F, names), _Plain(F)
    budget = REPEATED * F.operations
    found: list[dict[str, Any]] = []
    for end in F.outputs.tolist():
        members = writer.needed(end)
        budget -= len(members)
        if budget < 0:
            return None
        simple = plain.function(end)
        if simple is not None:
            found.append(simple_object(simple, names))
            continue
        rows, nodes = writer.written(members, [end])
        found.append({"type": "ScalarNonlinearFunction", "root": rows[0], "node_list": nodes})
    return found


def model(maps: Mapping[str, Map], names: Sequence[str]) -> dict[str, Any]:
    """Write a model that only holds maps: each is a constraint of its name in Reals. A map of fewer inputs than there
    are names takes the last ones; one without rows is left out.
    """
    parameters = {name: value for F in maps.values() for name, value in F.parameters.items()}
    return {
        "version": VERSION,
        "variables": [{"name": name} for name in (*names, *parameters)],
        "objective": {"sense": "feasibility"},
        "constraints": [
            *(parameter(name, value) for name, value in parameters.items()),
            *(
                {
                    "name": label,
                    "function": vector(F, names[len(names) - F.inputs :]),
                    "set": {"type": "Reals", "dimension": F.rows},
                }
                for label, F in maps.items()
                if F.rows
            ),
        ],
    }


def parameter(name: str, value: float) -> dict[str, Any]:
    """Write the constraint that a parameter is; JuMP takes its variable for one by that."""
    return {"function": {"type": "Variable", "name": name}, "set": {"type": "Parameter", "value": value}}


VERSION = {"major": 1, "minor": 7}
"""The first with bare names and numbers as arguments; every version since has what is written here."""


def simple_object(function: Affine | Quadratic, names: Sequence[str]) -> dict[str, Any]:
    affine = function.affine if isinstance(function, Quadratic) else function
    terms = [{"coefficient": c, "variable": names[k]} for k, c in zip(affine.columns, affine.values, strict=True)]
    if isinstance(function, Affine):
        return {"type": "ScalarAffineFunction", "terms": terms, "constant": affine.constant}
    products = [{"coefficient": c, "variable_1": names[i], "variable_2": names[j]} for i, j, c in function.products]
    return {
        "type": "ScalarQuadraticFunction",
        "quadratic_terms": products,
        "affine_terms": terms,
        "constant": affine.constant,
    }


class _Writer:
    """The terms of a map, made from its operations in their order."""

    def __init__(self, F: Map, names: Sequence[str]) -> None:
        self._first = F.inputs + F.constants.size
        self._operations = list(zip(F.heads.tolist(), F.left.tolist(), F.right.tolist(), strict=True))
        arguments = np.concatenate([F.left, F.right[F.right >= 0], F.outputs])
        self._uses: list[int] = np.bincount(arguments, minlength=self._first + F.operations).tolist()
        self._terms: list[Term] = [*names, *F.constants.tolist(), *[None] * F.operations]
        for name, place in F.named.items():
            self._terms[F.inputs + place] = name
        self._depth = [0] * (self._first + F.operations + 1)  # the last one is for the argument that is not there

    def written(self, members: Iterable[int], ends: Iterable[int]) -> tuple[list[Term], list[Term]]:
        """Return rows and node_list: `members` are the operations they need, in their order."""
        terms, depth, nodes = self._terms, self._depth, list[Term]()
        for k in members:
            head, a, b = self._operations[k]
            value = self._first + k
            terms[value], depth[value] = self._term(Operator(head), a, b)
            if self._uses[value] > 1 or depth[value] >= DEPTH:
                nodes.append(terms[value])
                terms[value], depth[value] = {"type": "node", "index": len(nodes)}, 0
        return [terms[v] if isinstance(terms[v], dict) else {"type": "+", "args": [terms[v]]} for v in ends], nodes

    def _term(self, head: Operator, a: int, b: int) -> tuple[Term, int]:
        terms, depth = self._terms, self._depth
        left = terms[a]
        if head in CHAINED and a >= self._first and left["type"] == WRITTEN[head]:
            left["args"].append(terms[b])  # which nothing else uses, or it would be a node
            return left, max(depth[a], depth[b] + 1)
        arguments = [left] if b < 0 else [left, terms[b]]
        if head is Operator.NOT:
            arguments += [0.0, 1.0]
        elif head is Operator.CHOOSE:
            arguments += [0.0]
        return {"type": WRITTEN.get(head, "ifelse"), "args": arguments}, max(depth[a], depth[b]) + 1

    def needed(self, end: int) -> list[int]:
        """Return the operations that a value needs, in their order."""
        seen: set[int] = set()
        stack = [end - self._first]
        while stack:
            k = stack.pop()
            if k >= 0 and k not in seen:
                seen.add(k)
                stack += (self._operations[k][1] - self._first, self._operations[k][2] - self._first)
        return sorted(seen)


class _Plain:
    """Rows that are affine or quadratic, and read back as the same operations."""

    def __init__(self, F: Map) -> None:
        self._F = F
        self._operations = list(zip(F.heads.tolist(), F.left.tolist(), F.right.tolist(), strict=True))
        self._reader = Functions("", {str(k): k for k in range(F.inputs)})
        build, self._number = self._reader.build, list(range(F.inputs))
        self._named = {F.inputs + place for place in F.named.values()}
        self._number += [build.constant(c) for c in F.constants.tolist()]
        for head, a, b in self._operations:
            self._number.append(build.apply(Operator(head), self._number[a], self._number[b] if b >= 0 else -1))

    def function(self, end: int) -> Affine | Quadratic | None:
        """Return the row with this value, None where it is neither affine nor quadratic, or in another order of
        operations.
        """
        products: list[tuple[int, int, float]] = []
        affine = Affine([], [], 0.0)
        for sign, value in reversed(self._summands(end)):
            factor, what = self._factor(value)
            if what is None:
                return None
            if what < 0:
                affine.constant = sign * factor
            elif what < self._F.inputs:
                affine.columns.append(what)
                affine.values.append(sign * factor)
            else:
                _, i, j = self._operation(what)
                products.append((i, j, sign * factor if i != j else 2.0 * sign * factor))
                if not math.isfinite(products[-1][2]):
                    return None
        if affine.constant == 0.0 and math.copysign(1.0, affine.constant) < 0:
            return None  # a side of a set has no room for the sign of a zero
        found = Quadratic(products, affine) if products else affine
        return found if self._reader.value(found) == self._number[end] else None

    def _operation(self, value: int) -> tuple[int, int, int]:
        first = self._F.inputs + self._F.constants.size
        return self._operations[value - first] if value >= first else (-1, -1, -1)

    def _summands(self, value: int) -> list[tuple[float, int]]:
        """Return (sign, value), the last one first."""
        found: list[tuple[float, int]] = []
        while True:
            head, a, b = self._operation(value)
            if head not in (Operator.ADD, Operator.SUB):
                break
            found.append((1.0 if head == Operator.ADD else -1.0, b))
            value = a
        head, a, _ = self._operation(value)
        return [*found, (-1.0, a) if head == Operator.NEG else (1.0, value)]

    def _factor(self, value: int) -> tuple[float, int | None]:
        """Return (c, x) of c·x, x the number of a variable or of a product of two; −1: the number c itself; None:
        neither.
        """
        inputs, constants = self._F.inputs, self._F.constants
        head, a, b = self._operation(value)
        if value in self._named or a in self._named:
            return 0.0, None
        if inputs <= value < inputs + constants.size:
            return float(constants[value - inputs]), -1
        factor = 1.0
        if head == Operator.MUL and inputs <= a < inputs + constants.size:
            factor = float(constants[a - inputs])
            value = b
            head, a, b = self._operation(value)
        single, product = value < inputs, head == Operator.MUL and max(a, b) < inputs
        return factor, value if single or product else None
