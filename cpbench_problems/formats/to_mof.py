"""Maps as functions of MathOptFormat, which read back as the same list of operations.

What is used once stands inside what uses it, as in a formula; what is used again, or would nest deeper than DEPTH, is
an entry of `node_list` after those it refers to. A chain of sums, products, minima or maxima has its terms in one
list. No root is a bare variable or number but +(x): so JuMP writes and wants it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from cpbench.formulations.expressions.map import Map
from cpbench.formulations.expressions.operators import Operator
from cpbench_problems.formats.mof_operators import CHAINED, WRITTEN

DEPTH = 12
"""Terms inside each other: parsers of JSON and readers of people go that deep without trouble."""
MINOR = 7
"""Of the first version with bare names and numbers as arguments; every later one has what is written here."""
REPEATED = 2
"""How often, on average, an operation may be written when every row is a separate function."""
Term = Any


def vector(F: Map, names: Sequence[str]) -> dict[str, Any]:
    """Write F as one VectorNonlinearFunction of the variables `names`."""
    rows, nodes = _Writer(F, names).written(range(F.operations), F.outputs.tolist())
    return {"type": "VectorNonlinearFunction", "rows": rows, "node_list": nodes}


def scalars(F: Map, names: Sequence[str]) -> list[dict[str, Any]] | None:
    """Write F as one function a row; None where rows share so much that this would be far longer than F is."""
    writer = _Writer(F, names)
    budget = REPEATED * F.operations
    result: list[dict[str, Any]] = []
    for end in F.outputs.tolist():
        members = writer.needed(end)
        budget -= len(members)
        if budget < 0:
            return None
        rows, nodes = writer.written(members, [end])
        result.append({"type": "ScalarNonlinearFunction", "root": rows[0], "node_list": nodes})
    return result


class _Writer:
    """The terms of a map, made from its operations in their order."""

    def __init__(self, F: Map, names: Sequence[str]) -> None:
        self._first = F.inputs + F.constants.size
        self._operations = list(zip(F.heads.tolist(), F.left.tolist(), F.right.tolist(), strict=True))
        arguments = np.concatenate([F.left, F.right[F.right >= 0], F.outputs])
        self._uses: list[int] = np.bincount(arguments, minlength=self._first + F.operations).tolist()
        self._terms: list[Term] = [*names, *F.constants.tolist(), *[None] * F.operations]
        for name, index in F.named.items():
            self._terms[F.inputs + index] = name
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
