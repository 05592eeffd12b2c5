"""A large matrix as a small picture: the largest entry of every square cell; how the matrices of a problem stand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench.formulations.base import Problem
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Matrix

PLACES: dict[str, tuple[tuple[str, ...], ...]] = {
    "mlcp": (("A", "C"), ("D", "B")),
    "fcm": (("W", "V"), ("", "R")),
    "qp": (("Q",), ("A",), ("C",)),
}
"""Where matrices stand; else they stand in a row."""


@dataclass(frozen=True, eq=False)
class Coarse:
    """`largest` : max|M_ij| in every cell of `step` rows and columns, 0 of an empty one. `step` : entries a side."""

    largest: Dense
    step: int


def coarsened(M: Matrix, cells: int, block: int = 1) -> Coarse:
    """Coarsen M to at most `cells` (rounded up) cells a side; a cell holds whole blocks of `block` rows and columns.

    >>> coarsened(np.diag([1.0, -2.0, 3.0, 0.0]), 2).largest.tolist()
    [[2.0, 0.0], [0.0, 3.0]]
    """
    rows, cols = M.shape
    blocks = -(-max(rows, cols, 1) // block)
    step = block * (-(-blocks // cells)) if blocks * block > cells else 1
    coo = matrices.sparse(M).tocoo()
    largest = np.zeros((-(-rows // step), -(-cols // step)))
    np.maximum.at(largest, (coo.row // step, coo.col // step), np.abs(coo.data))
    return Coarse(largest, step)


def arranged(problem: Problem) -> list[list[str]]:
    """Arrange names of the matrices that have rows and columns, in rows as they stand in the equations; '' for a
    gap.

    >>> from cpbench.formulations.lcp import LCP
    >>> arranged(LCP(M=np.eye(2), q=np.ones(2)))
    [['M']]
    """
    there = [
        name
        for name, value in problem.data().items()
        if value.ndim == 2 and min(value.shape) > 0 and name not in ("mu", "mu_r")
    ]
    places = [[name if name in there else "" for name in row] for row in PLACES.get(problem.node, (tuple(there),))]
    rows = [row for row in places if any(row)]
    columns = [column for column in zip(*rows, strict=True) if any(column)]
    return [list(row) for row in zip(*columns, strict=True)]
