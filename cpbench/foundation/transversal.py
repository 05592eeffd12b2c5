"""Structural singularity of a sparse matrix: whether some choice of its values makes it nonsingular.

That is so when every row can be matched with a different column in which it has an entry. A greedy matching that
takes rows and columns with one choice left first (Karp and Sipser 1981) comes within a few rows of the best one on
the optimality conditions met here; what is left is matched along alternating paths (Duff 1981). SciPy's
structural_rank, which starts from nothing, took minutes on the conditions of CONT-101, 20,295 rows.
"""

from __future__ import annotations

import itertools

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Sparse


def has_full_structural_rank(A: Sparse) -> bool:
    """Return whether the rows of a square matrix can be matched with its columns; stored zeros count as entries."""
    if A.diagonal().all():
        return True
    rows, columns = _neighbours(A), _neighbours(sp.csr_array(A.T))
    column_of = _greedy(rows, columns)
    row_of = [-1] * len(columns)
    for row, column in enumerate(column_of):
        if column >= 0:
            row_of[column] = row
    return all(column >= 0 or _augment(row, rows, column_of, row_of) for row, column in enumerate(list(column_of)))


def _neighbours(A: Sparse) -> list[list[int]]:
    first, columns = A.indptr.tolist(), A.indices.tolist()
    return [columns[start:stop] for start, stop in itertools.pairwise(first)]


def _greedy(rows: list[list[int]], columns: list[list[int]]) -> list[int]:
    """Return a column for most rows, −1 for the others; neighbours with the fewest choices first."""
    sides = (rows, columns)
    match = [-1] * len(rows), [-1] * len(columns)
    left = [len(r) for r in rows], [len(c) for c in columns]
    forced = [(side, i) for side in (0, 1) for i, choices in enumerate(left[side]) if choices == 1]

    def take(side: int, i: int) -> None:
        free = [j for j in sides[side][i] if match[1 - side][j] < 0]
        if match[side][i] >= 0 or not free:
            return
        j = min(free, key=left[1 - side].__getitem__)
        match[side][i], match[1 - side][j] = j, i
        for one, k in ((side, i), (1 - side, j)):
            for other in sides[one][k]:
                left[1 - one][other] -= 1
                if left[1 - one][other] == 1 and match[1 - one][other] < 0:
                    forced.append((1 - one, other))

    for row in np.argsort(left[0], kind="stable").tolist():
        while forced:
            take(*forced.pop())
        take(0, row)
    return match[0]


def _augment(start: int, rows: list[list[int]], column_of: list[int], row_of: list[int]) -> bool:
    """Match the row `start` by an alternating path to a free column, breadth first; False when there is none."""
    came_from: dict[int, int] = {}
    queue = [start]
    for row in queue:
        for column in rows[row]:
            if column in came_from:
                continue
            came_from[column] = row
            if row_of[column] >= 0:
                queue.append(row_of[column])
                continue
            return _flip(column, start, came_from, column_of, row_of)
    return False


def _flip(column: int, start: int, came_from: dict[int, int], column_of: list[int], row_of: list[int]) -> bool:
    """Give every row on the path from `start` to the free `column` the column after it."""
    while True:
        row = came_from[column]
        before = column_of[row]
        column_of[row], row_of[column] = column, row
        if row == start:
            return True
        column = before
