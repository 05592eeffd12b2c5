"""Lemke's method in whole numbers: what the compiled loops have to do, without rounding.

The tableau holds integers over one common denominator (Edmonds' pivots: every quotient is exact), so ties are ties.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

RAY, COMPLEMENTARY, CYCLES = "ray", "complementary", "cycles"


def lemke(M: Any, q: Any, first: int, *, lexicographic: bool = True) -> tuple[str, int, list[Fraction]]:
    """Return how the method ends on an LCP of whole numbers, its pivots, and z of the last basis.

    first : the row of the first pivot, where q is least. Of tied rows the lexicographic rule takes the one whose row of
    B⁻¹ over its pivot is least, columns in their order and `first` last (Cottle, Pang and Stone 1992, algorithm 4.4.5
    and section 4.9); without it the topmost row leaves, and a basis that comes again ends in CYCLES.
    """
    n = len(q)
    if min(q) >= 0:
        return COMPLEMENTARY, 0, [Fraction(0)] * n
    # w = I, z = −M, z₀ = −e, right-hand side
    T = [[int(i == j) for j in range(n)] + [-int(x) for x in M[i]] + [-1, int(q[i])] for i in range(n)]
    T[first] = [-x for x in T[first]]
    basis, denominator, entering, r, pivots = list(range(n)), 1, 2 * n, first, 0
    order = [j for j in range(n) if j != first] + [first]
    seen = set[tuple[int, ...]]()
    while True:
        pivot, row = T[r][entering], T[r]
        for i in range(n):
            if i != r:
                factor = T[i][entering]
                T[i] = [(pivot * x - factor * y) // denominator for x, y in zip(T[i], row, strict=True)]
        denominator, leaving, basis[r] = pivot, basis[r], entering
        pivots += 1
        z = [Fraction(0)] * (2 * n + 1)
        for i, variable in enumerate(basis):
            z[variable] = Fraction(T[i][-1], denominator)
        if leaving == 2 * n:
            return COMPLEMENTARY, pivots, z[n : 2 * n]
        entering = leaving + n if leaving < n else leaving - n
        blocking = [i for i in range(n) if T[i][entering] > 0]
        if not blocking:
            return RAY, pivots, z[n : 2 * n]
        if tuple(basis) in seen:
            return CYCLES, pivots, z[n : 2 * n]
        seen.add(tuple(basis))
        for column in (-1, *(order if lexicographic else ())):
            ratios = [Fraction(T[i][column], T[i][entering]) for i in blocking]
            blocking = [i for i, ratio in zip(blocking, ratios, strict=True) if ratio == min(ratios)]
            if any(basis[i] == 2 * n for i in blocking):
                blocking = [i for i in blocking if basis[i] == 2 * n]
        r = blocking[0]


def simplex_as_lcp(A: list[list[int]], b: list[int], c: list[int]) -> tuple[Any, Any]:
    """Return M and q of the conditions of optimality of min cᵀx, Ax ≤ b, x ≥ 0: [[0, Aᵀ], [−A, 0]] and (c, b)."""
    m, n = len(A), len(c)
    M = [[0] * n + [A[i][j] for i in range(m)] for j in range(n)] + [[-x for x in A[i]] + [0] * m for i in range(m)]
    return M, [*c, *b]
