"""The unknowns of a game, of least squares or of a boxed LCP in an answer to the problem that was made of it."""

from __future__ import annotations

import numpy as np

from cpbench.errors import PointError
from cpbench.formulations.applications.boxed import rows_of
from cpbench.formulations.applications.game import game_sizes, strategies
from cpbench.formulations.applications.least_squares import columns_of
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.linear import AVI, LCP
from cpbench.formulations.programs import QP
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Vector

_SUM = 1e-9
"""How far the sum of probabilities may be from 1, as sums of rounded numbers are."""


def own_unknowns(problem: Problem, point: Point) -> dict[str, Vector] | None:
    """Return x and y of a game, x and the residual r of least squares, or x of a boxed LCP; None of any other problem,
    and where the answer has no probabilities."""
    if game_sizes(problem) is not None:
        try:
            x, y = strategies(problem, point)
        except PointError:
            return None
        return {"x": x, "y": y}
    z = point.arrays().get("z")
    if z is not None and (columns := columns_of(problem)) is not None:
        return {"x": z[:columns], "r": z[columns:]}
    if z is not None and (rows := rows_of(problem)) is not None:
        return {"x": z[:rows]}
    return None


def own_vector(problem: Problem, point: Point) -> Vector | None:
    """Return (x, y) of a game, x of least squares or x of a boxed LCP as one vector; None of any other problem."""
    found = own_unknowns(problem, point)
    return None if found is None else np.concatenate([part for name, part in found.items() if name != "r"])


def from_own_vector(problem: Problem, vector: Vector) -> Vector:
    """Return the unknowns z of the problem from those of the game, least squares or boxed LCP that it was made of; any
    other vector as it is.

    Least squares and boxed LCPs have fewer unknowns of their own, which determine the others. Those of a game are as
    many as z; they are probabilities, so that each player's sum to 1.
    """
    sizes = game_sizes(problem)
    if isinstance(problem, LCP) and sizes is not None and vector.size == sum(sizes):
        return _of_game(problem, vector, sizes[0])
    columns, rows = columns_of(problem), rows_of(problem)
    if isinstance(problem, QP) and columns is not None and vector.size == columns:
        return np.concatenate([vector, matrices.sparse(problem.C)[:, :columns] @ vector - problem.d])
    if isinstance(problem, AVI) and rows is not None and vector.size == rows < problem.point_sizes["z"]:
        M = matrices.sparse(problem.M)[:rows]
        w = M[:, :rows] @ vector + problem.q[:rows]
        friction = np.diff(M[:, rows:].indptr) > 0  # rows with a friction index, whose force is κ - κ'
        return np.concatenate([vector, np.maximum(w[friction], 0.0), np.maximum(-w[friction], 0.0)])
    return vector


def _of_game(problem: LCP, vector: Vector, m: int) -> Vector:
    """Return u = x/(xᵀB̂y), v = y/(xᵀÂy) of probabilities x and y; a vector of other numbers as it is."""
    x, y = vector[:m], vector[m:]
    M = matrices.dense(problem.M)
    row_cost, column_cost = float(x @ M[:m, m:] @ y), float(y @ M[m:, :m] @ x)
    sums = np.array([x.sum(), y.sum()])
    if not (np.abs(sums - 1.0) <= _SUM).all() or min(row_cost, column_cost) <= 0.0:
        return vector
    return np.concatenate([x / column_cost, y / row_cost])
