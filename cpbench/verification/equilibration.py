"""Scaling of a problem's matrix that is the same in all units.

D and C make the entries D_i A_ij C_j of every row, and of every column, 1 on average, over the entries that are not 0
(Sinkhorn and Knopp 1967, with the numbers of entries for sums). They minimize Σ D_i A_ij C_j − Σ log D_i A_ij C_j,
which is convex in log D and log C, so that they are unique, up to a factor of each connected part. Other than scalings
by the largest entry of each row, they follow a change of units: in units u_i of row i, D_i becomes D_i/u_i. Entries
that are far smaller than others of their row and column, rounding mostly, change little.

The first guess is the least-squares solution of log D_i A_ij C_j = 0 (Curtis and Reid 1972), which follows units, too;
sweeps over rows and columns correct it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from cpbench.foundation.matrices import Vector

SWEEPS = 200
STEPS = 400
"""Limit of conjugate gradients."""
ENOUGH = 1e-5
"""The mean of a row may be off by this much in the root mean square: sizes are compared, no digits."""
GUESSED = 1e-5
"""The first guess may be off by this much in logarithms, in the root mean square."""
LARGEST = 80.0
"""Logarithms of entries that the first guess leaves are cut off here, so that sums of products are numbers."""


def equilibrate(K: Any) -> Vector:
    """Return D of a symmetric matrix of nonnegative entries, so that D_i K_ij D_j are about 1; 1 for an empty row."""
    D, C = equilibrate_apart(K)
    return np.sqrt(D) * np.sqrt(C)


def equilibrate_apart(A: Any) -> tuple[Vector, Vector]:
    """Return D and C of the rows and the columns of a matrix of nonnegative entries, so that D_i A_ij C_j are about 1;
    1 for those that are empty."""
    A = sp.csr_array(A)

    def at_places(values: Any) -> Any:
        return sp.csr_array((values, A.indices, A.indptr), shape=A.shape)

    def by_entry(D: Vector, C: Vector) -> Any:
        return np.repeat(D, np.diff(A.indptr)) + C[A.indices]

    def sums(values: Any) -> tuple[Any, Any]:
        rows = np.repeat(np.arange(A.shape[0]), np.diff(A.indptr))
        return np.bincount(rows, values, A.shape[0]), np.bincount(A.indices, values, A.shape[1])

    some = A.data > 0
    logs = np.log(A.data, out=np.zeros(A.nnz), where=some)
    counts, beside = sums(some)
    D, C = _first_guess(*sums(logs), at_places(some.astype(np.float64)), counts, beside)
    left = logs + by_entry(D, C)
    if (left * some > LARGEST).any():  # cut off, it would be another matrix: the largest of each row is 1
        rows = A.max(axis=1).toarray().ravel()
        D, C = -np.log(np.where(rows > 0, rows, 1.0)), np.zeros(A.shape[1])
        left = logs + by_entry(D, C)
    W = at_places(np.exp(np.clip(left, -LARGEST, LARGEST)) * some)
    turned, d, c = W.T, np.ones(A.shape[0]), np.ones(A.shape[1])
    for _ in range(SWEEPS):
        d = _ratio(counts, W @ c)
        c = _ratio(beside, turned @ d)
        off = d * (W @ c) - counts
        if off @ (off / np.maximum(counts, 1.0)) <= ENOUGH**2 * counts.sum():
            break
    return np.exp(D) * d, np.exp(C) * c


def _first_guess(
    by_row: Vector, by_column: Vector, pattern: Any, counts: Vector, beside: Vector
) -> tuple[Vector, Vector]:
    """Return the d and e with the least Σ (l_ij + d_i + e_j)², l the logarithms of the entries, of which the sums are
    given: e follows from d, which conjugate gradients find, in units of the root of the number of entries of each row.
    """
    root, per_column, turned = np.sqrt(_ratio(1.0, counts)), _ratio(1.0, beside), pattern.T

    def without_columns(d: Vector) -> Vector:
        return d - root * (pattern @ (per_column * (turned @ (root * d))))

    e = -per_column * by_column
    rest = -root * (by_row + pattern @ e)
    reduced = spla.LinearOperator((rest.size, rest.size), matvec=without_columns, dtype=np.float64)
    d = root * spla.cg(reduced, rest, rtol=0.0, atol=GUESSED * math.sqrt(counts.sum()), maxiter=STEPS)[0]
    return d, e - per_column * (turned @ d)


def _ratio(x: Any, y: Vector) -> Vector:
    return np.divide(x, y, out=np.ones(y.shape), where=y > 0)
