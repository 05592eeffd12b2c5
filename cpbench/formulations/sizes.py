"""Sizes that errors are measured against: none of them may be set by data or answers that have no part in the error."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from cpbench.foundation.matrices import Matrix, Vector, freeze


def least(*sizes: float) -> float:
    """Return the smallest positive of the numbers, 0 where there is none."""
    return min((size for size in sizes if size > 0), default=0.0)


def ratio(size: float, per: float) -> float:
    """Return size / per, 0 where nothing can be said."""
    return size / per if per > 0 else 0.0


def row_sizes(A: Matrix, groups: Any = None) -> Vector:
    """Return max|A_ij| of every row, 1 for a zero row; with `groups` (the group of every row) the largest of its group.

    A row divided by its size has the units of the unknowns, and its multiplier times it those of the forces.
    """
    largest = np.zeros(A.shape[0])
    if sp.issparse(A):
        coo: Any = sp.coo_array(A)
        np.maximum.at(largest, coo.row, np.abs(coo.data))
    elif A.shape[1]:
        largest = np.abs(A).max(axis=1)
    if groups is not None:
        largest = group_max(largest, groups)[groups]
    return np.where(largest > 0, largest, 1.0)


def group_max(x: Vector, groups: Any) -> Vector:
    """Return max|x_i| over every group; groups are numbered from 0."""
    result = np.zeros(int(groups[-1]) + 1 if len(groups) else 0)
    np.maximum.at(result, groups, np.abs(x))
    return result


def least_squares(apply: Any, b: Vector) -> Vector:
    """Return the shortest x with ‖Ax − b‖ least, by LSMR, for a matrix or operator A that is singular; to about
    1e-8."""
    return freeze(np.asarray(spla.lsmr(apply, b, atol=1e-12, btol=1e-12, maxiter=1000)[0]))
