"""All equilibria of a bimatrix game by the vertices of its two best-response polytopes, over the rationals.

With payoffs A, B > 0 these are P = {x ≥ 0, Bᵀx ≤ 1} and Q = {y ≥ 0, Ay ≤ 1}. A vertex has the labels of its tight
inequalities, row i of x_i = 0 and of (Ay)_i = 1, column j of y_j = 0 and of (Bᵀx)_j = 1. A pair of vertices other than
0 is an equilibrium where it has all labels (Lemke and Howson 1964), and all equilibria are hulls of these: of each set
of vertices of P all of which go with all of a set of Q (Mangasarian 1964; von Stengel 2002, theorem 2.14). So there are
finitely many where no vertex goes with two.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import numpy as np

from cpbench.foundation.matrices import Dense

SECONDS = 20.0
"""Limit of the search [s]; a game of 12 by 12 takes about as long."""
Labels = frozenset[int]
Vertex = tuple[Fraction, ...]


def equilibria(row_costs: Dense, column_costs: Dense, seconds: float = SECONDS) -> list[tuple[Vertex, Vertex]] | None:
    """Return the extreme equilibria (x, y), probabilities of rows and columns; None where they take longer.

    row_costs, column_costs : (m, n) costs of both players, taken exactly.
    """
    m, n = row_costs.shape
    end = time.monotonic() + seconds
    A, B = (_payoffs(costs) for costs in (row_costs, column_costs))
    try:
        # rows are labels 0 to m − 1, columns those from m on: of Q both are turned round
        of_x = dict(_vertices(B.T, end))
        of_y = {frozenset((k + m) % (m + n) for k in labels): y for labels, y in _vertices(A, end)}
    except TimeoutError:
        return None
    having = [0] * (m + n)  # of each label the vertices of Q that have it, as bits of a number
    for bit, labels in enumerate(of_y):
        for label in labels:
            having[label] |= 1 << bit
    pairs: list[tuple[Vertex, Vertex]] = []
    vertices = list(of_y.values())
    for labels, x in of_x.items():
        some = (1 << len(vertices)) - 1
        for label in range(m + n):
            some &= -1 if label in labels else having[label]
        while some and any(x):
            bit = some.bit_length() - 1
            some -= 1 << bit
            pairs.append((_shares(x), _shares(vertices[bit])))
    return pairs


def _payoffs(costs: Dense) -> Any:
    """Return positive payoffs as whole numbers: the opposite of costs, plus a constant, times another."""
    exact = [[Fraction(float(cost)) for cost in row] for row in costs]
    most = max(max(row) for row in exact)
    scale = math.lcm(*(value.denominator for row in exact for value in row))
    return np.array([[int((most + 1 - value) * scale) for value in row] for row in exact], dtype=object)


def _shares(x: Vertex) -> Vertex:
    return tuple(value / sum(x) for value in x)


def _vertices(A: Any, end: float) -> Iterator[tuple[Labels, Vertex]]:
    """Yield each vertex of {x ≥ 0, Ax ≤ 1}, A > 0 of whole numbers, with its tight inequalities: those of x first.

    Every feasible basis is reached from 0 by exact pivots (Edmonds: a tableau of whole numbers over one denominator).
    Raises TimeoutError.
    """
    k, d = A.shape
    first = np.concatenate([A, np.eye(k, dtype=object), np.ones((k, 1), dtype=object)], axis=1)
    waiting, known, seen = [(tuple(range(d, d + k)), first, 1)], {frozenset(range(d, d + k))}, set[Labels]()
    while waiting:
        if time.monotonic() > end:
            raise TimeoutError
        basis, T, denominator = waiting.pop()
        values = dict(zip(basis, T[:, -1].tolist(), strict=True))
        labels = frozenset(j for j in range(d + k) if not values.get(j, 0))
        if labels not in seen:
            seen.add(labels)
            yield labels, tuple(Fraction(values.get(j, 0), denominator) for j in range(d))
        for entering in set(range(d + k)) - set(basis):
            column = T[:, entering].tolist()
            ratios = {i: Fraction(T[i, -1], column[i]) for i in range(k) if column[i] > 0}
            least = min(ratios.values())
            for r in (i for i, ratio in ratios.items() if ratio == least):
                after = (*basis[:r], entering, *basis[r + 1 :])
                if frozenset(after) not in known:
                    known.add(frozenset(after))
                    pivot = column[r]
                    new = (pivot * T - np.outer(T[:, entering], T[r])) // denominator
                    new[r] = T[r]
                    waiting.append((after, new, pivot))
