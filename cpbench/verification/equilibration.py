"""Scaling of a problem's matrix that is the same in all units.

D and C are the least-squares solution of log A_ij + log D_i + log C_j = 0 over the entries (Curtis and Reid 1972).
Other than scalings by the largest entry of each row, it follows a change of units: in units u_i of row i, D_i becomes
D_i/u_i. Entries that stay far below 1 once scaled, rounding mostly, lose their weight.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.matrices import Vector

ROUNDS = 32
STEPS = 200
LOG_2 = float(np.log(2.0))
BITS = 0.01
"""Conjugate gradients end where rows are off by less in the root mean square: sizes are compared, no digits."""
SINGLE = np.float32
"""Logarithms of sizes need six digits at most, and take half of the time with these."""


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
    about 1.

    Problems side by side, as `sums` says, come out as each by itself; columns have the numbers of the rows.
    """
    A = A if A.data.all() else _without_zeros(A)
    lengths, logs = np.diff(A.indptr), np.log2(A.data).astype(SINGLE)
    products = _Products.of(A)
    d, e = np.zeros(A.shape[0], SINGLE), np.zeros(A.shape[1], SINGLE)
    weights = np.ones(logs.size, SINGLE)
    going: Any = True
    for i in range(ROUNDS):
        if i:
            residuals = np.repeat(d, lengths)
            residuals += logs
            residuals += np.take(e, A.indices, mode="clip")  # the default looks at every index: three times as long
            residuals *= LOG_2
            weights = np.exp(np.minimum(residuals, 0.0, out=residuals), out=residuals)
        new_d, new_e, moved = _least_squares(products, weights, logs, d, sums)
        if going is True:
            d, e = new_d, new_e
        else:  # who has ended stays
            some = sums.spread(going)
            d, e = np.where(some, new_d, d), np.where(some, new_e, e)
        going = moved if going is True else going & moved
        if not sums.any(going):
            break
    return np.exp2(d.astype(np.float64)), np.exp2(e.astype(np.float64))


@dataclass(frozen=True)
class _Products:
    """A sparse matrix and its transposed, whose places stay while their numbers change: to make others takes long."""

    by_rows: Any
    by_columns: Any

    @classmethod
    def of(cls, A: Any) -> _Products:
        """Take the places of a CSR matrix."""
        by_rows = sp.csr_array((np.ones(A.nnz, SINGLE), A.indices, A.indptr), shape=A.shape)
        return cls(by_rows, by_rows.T)

    def sums(self, values: Vector) -> tuple[Vector, Vector]:
        """Put these numbers in the places; return the sums of the rows and of the columns."""
        self.by_rows.data = self.by_columns.data = values
        rows, columns = self.by_rows.shape
        return self.by_rows @ np.ones(columns, SINGLE), self.by_columns @ np.ones(
            rows, SINGLE
        )  # a tenth of the time of `sum`


def _without_zeros(A: Any) -> Any:
    A = A.copy()
    A.eliminate_zeros()
    return A


def _least_squares(
    products: _Products, weights: Vector, logs: Vector, d: Vector, sums: Sums
) -> tuple[Vector, Vector, Any]:
    """Return the d and e with the least Σ W_ij (l_ij + d_i + e_j)² and whether any step was taken.

    e is eliminated; conjugate gradients find d from a first guess, scaled by the diagonal.
    """
    of_rows, of_columns = products.sums(weights * logs)
    beside_rows, beside_columns = products.sums(weights)
    per_row, per_column = (np.divide(1.0, s, out=np.zeros_like(s), where=s > 0) for s in (beside_rows, beside_columns))
    W, transposed = products.by_rows, products.by_columns

    def opposite(d: Vector, constant: Vector | float = 0.0) -> Vector:
        return -per_column * (transposed @ d + constant)

    e = opposite(d, of_columns)
    r = -(of_rows + beside_rows * d + W @ e)
    enough, p, old = BITS**2 * sums.dot(beside_rows, np.ones(d.size)), np.zeros(d.size), 1.0
    going: Any = True
    moved: Any = False
    for step in range(STEPS):
        z = per_row * r
        new = sums.dot(z, r)
        going = (new > enough) & going
        if not sums.any(going):
            break
        p = z if not step else z + sums.spread(sums.ratio(new, old, going)) * p
        q = opposite(p)
        Ap = beside_rows * p + W @ q
        curvature = sums.dot(p, Ap)
        going = going & (curvature > 0)  # else nothing is left but rounding
        if not sums.any(going):
            break
        alpha = sums.spread(sums.ratio(new, curvature, going))
        d, e, r, old, moved = d + alpha * p, e + alpha * q, r - alpha * Ap, new, moved | going
    return d, e, moved
