"""Bimatrix games as linear complementarity problems (Cottle, Pang, Stone, *The Linear Complementarity Problem*, §1.4).

Two players choose a row and a column; x and y are the probabilities of their choices. Payoffs become costs > 0, since a
constant added to all payoffs of a player changes no equilibrium:

    Â = max A − A + s,  B̂ = max B − B + s,  s = max − min of each (1 where that is 0)
    0 ≤ u ⟂ Âv − 1 ≥ 0,  0 ≤ v ⟂ B̂ᵀu − 1 ≥ 0;  x = u/Σu, y = v/Σv

Every solution is an equilibrium, and every equilibrium is one solution: v = y/(xᵀÂy), u = x/(xᵀB̂y). The differences
are exact where payoffs are integers.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.errors import PointError, ProblemError
from cpbench.formulations.base import Info, Point, Problem
from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Vector

GAME = "game"
"""Property of an LCP that is a game: the number of rows and of columns."""


def game_problem(A: Any, B: Any, name: str = "") -> LCP:
    """Return the LCP of a game with payoffs A and B, shape (m, n), of the player who chooses the row and of the other.

    Raises ProblemError where the shapes differ, a matrix is empty, or an entry is not finite.
    """
    costs = [_costs(payoff, label) for payoff, label in ((A, "A"), (B, "B"))]
    (m, n), other = costs[0].shape, costs[1].shape
    if other != (m, n):
        raise ProblemError("game.B", f"is {other[0]} x {other[1]}, expected {m} x {n} as A is")
    M = np.zeros((m + n, m + n))
    M[:m, m:], M[m:, :m] = costs[0], costs[1].T
    info = Info(title=f"bimatrix game, {m} x {n}", properties={GAME: [m, n]})
    return LCP(M=M, q=-np.ones(m + n), name=name, info=info)


def game_sizes(problem: Problem) -> tuple[int, int] | None:
    """Return the rows and columns of the game that a problem is, None where it is none."""
    sizes = problem.info.properties.get(GAME)
    if problem.node != "lcp" or not isinstance(sizes, list | tuple | np.ndarray) or len(sizes) != 2:
        return None
    m, n = (int(size) if isinstance(size, int | np.integer) else 0 for size in sizes)
    return (m, n) if min(m, n) > 0 and m + n == sum(problem.point_sizes.values()) else None


def strategies(problem: Problem, point: Point) -> tuple[Vector, Vector]:
    """Return the probabilities (x, y), shapes (m,) and (n,), of an answer to a problem that is a game: its two parts,
    each divided by its sum, negative entries as 0.

    Raises PointError where a part has no positive number, or an infinite one.
    """
    sizes = game_sizes(problem)
    if sizes is None or not isinstance(point, LCPPoint):
        raise PointError(f"{problem.node}: is no game")
    parts: list[Vector] = []
    for name, part in (("x", point.z[: sizes[0]]), ("y", point.z[sizes[0] :])):
        positive = np.maximum(part, 0.0)
        largest = float(positive.max())
        if not 0.0 < largest < np.inf:
            raise PointError(f"game: {name} are no probabilities: the largest of its numbers is {part.max():g}")
        scaled = positive / largest  # whose sum does not overflow
        parts.append(scaled / scaled.sum())
    return parts[0], parts[1]


def _costs(payoff: Any, label: str) -> Dense:
    """Return costs > 0 in place of payoffs; raises ProblemError."""
    dense = matrices.dense(matrices.matrix(payoff, f"game.{label}"))
    if not dense.size:
        raise ProblemError(
            f"game.{label}", f"is {dense.shape[0]} x {dense.shape[1]}, expected a choice for each player"
        )
    most = float(dense.max())
    return (most - dense) + ((most - float(dense.min())) or 1.0)
