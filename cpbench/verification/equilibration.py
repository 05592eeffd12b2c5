"""Scaling of a problem's matrix that is the same in all units.

D and C make the entries D_i A_ij C_j of every row, and of every column, 1 on average, over the entries that are not 0
(Sinkhorn and Knopp 1967, with the numbers of entries for sums). They minimize Σ D_i A_ij C_j − Σ log D_i A_ij C_j,
which is convex in log D and log C, so that they are unique, up to a factor of each connected part. Other than scalings
by the largest entry of each row, they follow a change of units: in units u_i of row i, D_i becomes D_i/u_i. Entries
that are far smaller than others of their row and column, rounding mostly, change little.

The first guess is the least-squares solution of log D_i A_ij C_j = 0 (Curtis and Reid 1972). Newton steps for log D
follow where sweeps over rows and columns are slow, by conjugate gradients, with the C that makes the columns right.
Connected parts side by side come out as each by itself.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Vector
from cpbench.verification.frame import inverse, some

SWEEPS = 32
STEPS = 100
"""Limit of conjugate gradients, for the first guess and for each Newton step."""
ENOUGH = 5e-4
"""The mean of a row, and log D_i, may be off by this much in the root mean square: sizes are compared, no digits."""
GUESSED = 0.01
"""The first guess may be off by this much in logarithms, in the root mean square."""
SLOWEST = 0.1
"""A sweep that keeps the share k of the error has 1/(1 - k) of it to go; no more than 1/SLOWEST is asked."""
FAST = 0.25
"""Where a sweep leaves more of the squares of what rows are off by, a Newton step follows."""
INEXACT = 0.1
"""Conjugate gradients leave this share of the right side of a Newton step."""
FARTHEST = 2.0
"""A Newton step changes no log D_i by more: it is right near 0 only."""
LARGEST = 80.0
"""Logarithms of entries that the first guess leaves are cut off here, so that sums of products are numbers."""


def equilibrate(K: Any, part: Any = None) -> Vector:
    """Return D of a symmetric matrix of nonnegative entries, so that D_i K_ij D_j are about 1; 1 for an empty row."""
    D, C = equilibrate_apart(K, part)
    return np.sqrt(D) * np.sqrt(C)


def equilibrate_apart(A: Any, part: Any = None) -> tuple[Vector, Vector]:
    """Return D and C of the rows and the columns of a matrix of nonnegative entries, an array or CSR, so that D_i A_ij
    C_j are about 1; 1 for those that are empty.

    part : (n,) the numbers of the connected parts of the rows, None where all are one.
    """
    pattern = _at_places_of(A, (_entries(A) > 0).astype(np.float64))
    counts, beside = pattern @ np.ones(A.shape[1]), pattern.T @ np.ones(A.shape[0])
    given = _logs(A)
    D, C = _first_guess(_at_places_of(A, given), pattern, counts, beside, part)
    logs = given + _by_entry(A, D, C)
    if (logs * _entries(pattern) > LARGEST).any():  # cut off, it would be another matrix
        D, C = _largest_one(A, D, C)
        logs = given + _by_entry(A, D, C)
    W = _at_places_of(A, np.exp(np.clip(logs, -LARGEST, LARGEST)) * _entries(pattern))
    turned, enough = W.T, ENOUGH**2 * _sums(counts, part)
    d, c, before, going = _ratio(counts, W @ np.ones(A.shape[1])), np.ones(A.shape[1]), np.inf, np.bool_(True)
    for _ in range(SWEEPS):
        c = _ratio(beside, turned @ d)
        found = d * (W @ c)
        r = counts - found
        off = _sums(r * r * inverse(counts), part)
        kept = np.sqrt(np.divide(off, before, out=np.zeros(off.shape), where=before > 0))
        going &= off > enough * np.maximum(1.0 - kept, SLOWEST) ** 2  # a part that has ended keeps all of its error
        if not some(going):
            break
        factor, slow = _ratio(counts, found), going & (off > FAST * before)
        if some(slow):
            r = np.where(_spread(slow, part), r, 0.0)
            least = INEXACT**2 * _sums(r * r * inverse(found), part)
            step = _solved(W, d, c * c * inverse(beside), found, r, least, part)
            factor = np.where(_spread(slow, part), np.exp(np.clip(step, -FARTHEST, FARTHEST)), factor)
        d, before = d * np.where(_spread(going, part), factor, 1.0), off
    return np.exp(D) * d, np.exp(C) * c


def _first_guess(logs: Any, pattern: Any, counts: Vector, beside: Vector, part: Any) -> tuple[Vector, Vector]:
    """Return the d and e with the least Σ (l_ij + d_i + e_j)², l the logarithms of the entries."""
    per_column = inverse(beside)
    e = -per_column * (logs.T @ np.ones(counts.size))
    r = -(logs @ np.ones(beside.size) + pattern @ e)
    enough = GUESSED**2 * _sums(counts, part)
    d = _solved(pattern, 1.0, per_column, counts, r, enough, part)
    return d, e - per_column * (pattern.T @ d)


def _largest_one(A: Any, D: Vector, C: Vector) -> tuple[Vector, Vector]:
    """Return the logarithms D and C so that the largest entry of every row and of every column is 1 at most."""
    entries: Any = sp.coo_array(A)
    (i, j), logs, D, C = entries.coords, np.log(entries.data), D.copy(), C.copy()
    for scale, at in ((D, i), (C, j)):
        largest = np.full(scale.size, -np.inf)
        np.maximum.at(largest, at, logs + D[i] + C[j])
        scale -= np.where(np.isfinite(largest), largest, 0.0)
    return D, C


def _solved(W: Any, left: Any, weights: Vector, diagonal: Vector, r: Vector, enough: Any, part: Any) -> Vector:
    """Solve (diagonal − L weights Lᵀ)x = r, L_ij = left_i W_ij, by conjugate gradients, scaled by the diagonal, until
    rᵀr/diagonal is `enough`."""
    x, p, old, scale, turned = np.zeros(r.size), np.zeros(r.size), 1.0, inverse(diagonal), W.T
    for _ in range(STEPS):
        z = scale * r
        new = _sums(z * r, part)
        going = new > enough
        if not some(going):
            break
        p = z + _spread(new / old, part) * p
        q = diagonal * p - left * (W @ (weights * (turned @ (left * p))))
        curvature = _sums(p * q, part)
        falls = going & (curvature > 0)  # else nothing is left but rounding
        alpha = np.divide(new, curvature, out=np.zeros(np.shape(new)), where=falls)
        if not some(alpha):
            break
        alpha = _spread(alpha, part)
        x, r, old = x + alpha * p, r - alpha * q, np.where(new > 0, new, 1.0)
    return x


def _entries(A: Any) -> Any:
    return A if isinstance(A, np.ndarray) else A.data


def _at_places_of(A: Any, entries: Any) -> Any:
    """Return a matrix with other entries."""
    return entries if isinstance(A, np.ndarray) else sp.csr_array((entries, A.indices, A.indptr), shape=A.shape)


def _logs(A: Any) -> Any:
    """Return the logarithms of the entries, 0 of those that are 0."""
    entries = _entries(A)
    return np.log(entries, out=np.zeros(entries.shape), where=entries > 0)


def _by_entry(A: Any, d: Vector, e: Vector) -> Any:
    """Return d_i + e_j of every entry."""
    if isinstance(A, np.ndarray):
        return d[:, None] + e
    return np.repeat(d, np.diff(A.indptr)) + e[A.indices]


def _sums(values: Vector, part: Any) -> Any:
    """Return the sum over each part."""
    return np.add.reduce(values) if part is None else np.bincount(part, values)


def _spread(values: Any, part: Any) -> Any:
    """Return the value of its part, for every row."""
    return values if part is None else values[part]


def _ratio(x: Vector, y: Vector) -> Vector:
    return np.divide(x, y, out=np.ones(x.shape), where=y > 0)
