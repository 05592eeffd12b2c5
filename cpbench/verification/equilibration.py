"""Scaling of a problem's matrix that is the same in all units.

D and C make the entries D_i A_ij C_j of every row, and of every column, 1 on average, over the entries that are not 0
(Sinkhorn and Knopp 1967, with the numbers of entries for sums). They minimize Σ D_i A_ij C_j − Σ log D_i A_ij C_j,
which is convex in log D and log C, so that they are unique, up to a factor of each connected part. Other than scalings
by the largest entry of each row, they follow a change of units: in units u_i of row i, D_i becomes D_i/u_i. Entries
that are far smaller than others of their row and column, rounding mostly, change little.

The first guess is the least-squares solution of log D_i A_ij C_j = 0 (Curtis and Reid 1972). Newton steps for log D
follow where sweeps over rows and columns are slow, by conjugate gradients, with the C that makes the columns right.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Vector

SWEEPS, STEPS = 32, 100
ENOUGH = 5e-4
"""The mean of a row may be off by this much in the root mean square: sizes are compared, no digits."""
GUESSED = 0.01
"""The first guess may be off by this much in logarithms, in the root mean square."""
FAST = 0.25
"""Where a sweep leaves more of the squares of what rows are off by, a Newton step follows."""
INEXACT = 0.1
"""Conjugate gradients leave this share of the right side of a Newton step."""
FARTHEST = 3.0
"""A Newton step changes no log D_i by more: it is right near 0 only."""
LARGEST = 80.0
"""Logarithms of entries that the first guess leaves are cut off here, so that sums of them are numbers."""
SINGLE = np.float32
"""Sizes need six digits at most, and take half of the time with these."""


@dataclass(frozen=True)
class Sums:
    """The sums of conjugate gradients: over all rows, or over those of each of several problems side by side.

    Attributes
    ----------
    dot : xᵀy, a number or one for each problem. spread : these, for every row. any : whether one of the flags is true.
    ratio : x/y where the flag is true, else 0.
    """

    dot: Callable[[Vector, Vector], Any]
    spread: Callable[[Any], Any]
    any: Callable[[Any], bool]
    ratio: Callable[[Any, Any, Any], Any]

    @classmethod
    def of_each(cls, number: Any, count: int) -> Sums:
        """Add up by the number of the problem of each row."""
        size = number.size // max(count, 1)
        runs = bool((number == np.repeat(np.arange(count), size)).all()) if size * count == number.size else False

        def dot(x: Vector, y: Vector) -> Any:
            if runs:  # half of the time
                return np.einsum("ij,ij->i", x.reshape(count, size), y.reshape(count, size))
            return np.bincount(number, x * y, count)

        return cls(
            dot=dot,
            spread=lambda values: np.repeat(values, size) if runs else values[number],
            any=lambda flags: bool(np.any(flags)),
            ratio=lambda x, y, flags: np.divide(x, y, out=np.zeros(count), where=flags),
        )


WHOLE = Sums(
    dot=lambda x, y: float(x @ y),
    spread=lambda value: value,
    any=bool,
    ratio=lambda x, y, flag: x / y if flag else 0.0,
)


def equilibrate(K: Any, sums: Sums = WHOLE) -> Vector:
    """Return D of a symmetric CSR matrix of nonnegative entries, so that D_i K_ij D_j are about 1; 1 for an empty
    row."""
    D, C = equilibrate_apart(K, sums)
    return np.sqrt(D) * np.sqrt(C)


def equilibrate_apart(A: Any, sums: Sums = WHOLE) -> tuple[Vector, Vector]:
    """Return D and C of the rows and the columns of a CSR matrix of nonnegative entries, so that D_i A_ij C_j are
    about 1; 1 for those that are empty.

    Problems side by side, as `sums` says, come out as each by itself; columns have the numbers of the rows.
    """
    A = A if A.data.all() else _without_zeros(A)
    entries, logs = _Entries.of(A), np.log(A.data).astype(SINGLE)
    counts, beside = entries.row_sums(), entries.column_sums()
    d, e = _first_guess(entries, logs, counts, beside, sums)
    logs += np.repeat(d, entries.lengths)
    logs += np.take(e, A.indices, mode="clip")  # the default looks at every index: three times as long
    np.exp(np.clip(logs, -LARGEST, LARGEST, out=logs), out=entries.data)
    D, C = np.exp(d, dtype=np.float64), np.exp(e, dtype=np.float64)
    factor = _ratio(counts, entries.row_sums())
    enough = ENOUGH**2 * sums.dot(counts, np.ones(counts.size))
    going: Any = True
    before: Any = None
    for _ in range(SWEEPS):
        D *= factor
        entries.multiply_rows(factor)
        factor = _where(going, _ratio(beside, entries.column_sums()), 1.0, sums)
        C *= factor
        entries.multiply_columns(factor)
        found = entries.row_sums()
        r = counts - found
        off = sums.dot(r, r * _inverse(counts))
        going = (off > enough) & going
        if not sums.any(going):
            break
        factor = _where(going, _ratio(counts, found), 1.0, sums)
        slow = going & (off > FAST * before) if before is not None else False
        if sums.any(slow):
            r = _where(slow, r, 0.0, sums)
            least = INEXACT**2 * sums.dot(r, r * _inverse(found))
            step = _solved(entries, found, _inverse(beside), r, least, sums)
            factor = _where(slow, np.exp(np.clip(step, -FARTHEST, FARTHEST)), factor, sums)
        before = off
    return D, C


@dataclass(frozen=True)
class _Entries:
    """Positive numbers at the places of a sparse matrix; they change, the places stay.

    Attributes
    ----------
    by_rows, by_columns : the matrix and its transposed, with the same `data`. lengths : how many each row has.
    """

    by_rows: Any
    by_columns: Any
    data: Vector
    lengths: Any

    @classmethod
    def of(cls, A: Any) -> _Entries:
        """Put a 1 at the places of a CSR matrix."""
        by_rows = sp.csr_array((np.ones(A.nnz, SINGLE), A.indices, A.indptr), shape=A.shape)
        by_columns = by_rows.T
        by_columns.data = by_rows.data
        return cls(by_rows, by_columns, by_rows.data, np.diff(A.indptr))

    def row_sums(self) -> Vector:
        return self.by_rows @ np.ones(self.by_rows.shape[1], SINGLE)  # a tenth of the time of `sum`

    def column_sums(self) -> Vector:
        return self.by_columns @ np.ones(self.by_rows.shape[0], SINGLE)

    def multiply_rows(self, factors: Vector) -> None:
        self.data[:] *= np.repeat(factors, self.lengths)

    def multiply_columns(self, factors: Vector) -> None:
        self.data[:] *= np.take(factors, self.by_rows.indices, mode="clip")


def _without_zeros(A: Any) -> Any:
    A = A.copy()
    A.eliminate_zeros()
    return A


def _inverse(x: Vector) -> Vector:
    return np.divide(1.0, x, out=np.zeros_like(x), where=x > 0)


def _ratio(x: Vector, y: Vector) -> Vector:
    return np.divide(x, y, out=np.ones_like(x), where=y > 0)


def _where(flags: Any, values: Any, others: Any, sums: Sums) -> Any:
    """Return the values of flagged problems, and `others` of the rest."""
    return values if flags is True else np.where(sums.spread(flags), values, others).astype(SINGLE, copy=False)


def _first_guess(entries: _Entries, logs: Vector, counts: Vector, beside: Vector, sums: Sums) -> tuple[Vector, Vector]:
    """Return the d and e with the least Σ (l_ij + d_i + e_j)². The entries are 1."""
    per_column = _inverse(beside)
    entries.data[:] = logs
    of_rows, e = entries.row_sums(), -per_column * entries.column_sums()
    entries.data[:] = 1.0
    r = -(of_rows + entries.by_rows @ e)
    enough = GUESSED**2 * sums.dot(counts, np.ones(counts.size))
    d = _solved(entries, counts, per_column, r, enough, sums)
    return d, e - per_column * (entries.by_columns @ d)


def _solved(entries: _Entries, diagonal: Vector, per_column: Vector, r: Vector, enough: Any, sums: Sums) -> Vector:
    """Solve (diagonal − W per_column Wᵀ) x = r by conjugate gradients, W the entries, scaled by the diagonal, until
    rᵀr/diagonal is `enough`."""
    x, p, old = np.zeros_like(r), np.zeros_like(r), 1.0
    scale = _inverse(diagonal)
    going: Any = True
    for step in range(STEPS):
        z = scale * r
        new = sums.dot(z, r)
        going = (new > enough) & going
        if not sums.any(going):
            break
        p = z if not step else z + sums.spread(sums.ratio(new, old, going)) * p
        q = diagonal * p - entries.by_rows @ (per_column * (entries.by_columns @ p))
        curvature = sums.dot(p, q)
        going = going & (curvature > 0)  # else nothing is left but rounding
        if not sums.any(going):
            break
        alpha = sums.spread(sums.ratio(new, curvature, going))
        x, r, old = x + alpha * p, r - alpha * q, new
    return x
