"""A large matrix as a small picture: the largest entry of every square cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cpbench import matrices
from cpbench.matrices import Dense, Matrix


@dataclass(frozen=True, eq=False)
class Coarse:
    """`largest` : max|M_ij| in every cell of `step` rows and columns, 0 of an empty one. `step` : entries a side."""

    largest: Dense
    step: int


def coarsened(M: Matrix, cells: int, block: int = 1) -> Coarse:
    """M in at most `cells` (rounded up) cells a side; a cell holds whole blocks of `block` rows and columns.

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
