"""Multipliers of parallel rows: what they cancel is no size of anything.

A row that is given twice, or as an inequality and an equality, has multipliers that may be as large as one likes and
cancel. A row of the dual that counted them would be met by every answer.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.matrices import Vector

LARGE = 10.0
"""Multipliers that add less than so many times what else is in each row of the dual cannot hide anything."""
DIGITS = 40
"""Bits in which entries of parallel rows agree."""
SAME = 1e-11


def relief(problem: Any, lam: Vector, mu: Vector, rest: Vector) -> Vector:
    """Σ|A_ji||λ_j| + Σ|C_ji||μ_j| less the same of the sums over parallel rows, for every unknown i; shape (n,).

    `rest` are the sizes of the other terms: where multipliers add little to them, nothing is looked for.
    """
    multipliers = np.concatenate([lam, mu])
    if not multipliers.any():
        return np.zeros(rest.size)
    rows: Any = sp.vstack([sp.csr_array(problem.A), sp.csr_array(problem.C)], format="csr")
    return relief_of(rows, multipliers, rest)


def relief_of(rows: Any, multipliers: Vector, rest: Vector) -> Vector:
    """The same for the rows of one CSR matrix."""
    gross = abs(rows).T @ np.abs(multipliers)
    if not (gross > LARGE * rest).any():
        return np.zeros(rest.size)
    rows = rows.copy()
    rows.eliminate_zeros()  # a zero that is stored first is no length of its row
    group, length = _groups(rows)
    summed = np.bincount(group, multipliers * length)
    # a representative of each group stands for all of it, with the sum of what they push
    first = np.full(summed.size, -1)
    first[group[::-1]] = np.arange(group.size)[::-1]
    size = np.abs(summed) / np.abs(length[first])
    net = abs(rows)[first].T @ size
    return np.maximum(gross - net, 0.0)


def _groups(rows: Any) -> tuple[Any, Vector]:
    """The number of the group of parallel rows of each row, and the length of each along its group."""
    m, n = rows.shape
    filled = np.diff(rows.indptr) > 0
    lead = np.ones(m)
    lead[filled] = rows.data[rows.indptr[:-1][filled]]
    # Parallel rows are equal once divided by their first entries. Mantissas and exponents are compared apart, so that
    # a column in other units changes nothing but an exponent, and that in all rows alike.
    entries = rows.data / np.repeat(np.where(lead != 0, lead, 1.0), np.diff(rows.indptr))
    mantissa, exponent = np.frexp(entries)
    mantissa = np.round(mantissa * 2.0**DIGITS) / 2.0**DIGITS
    full = np.abs(mantissa) == 1.0
    mantissa, exponent = np.where(full, mantissa / 2, mantissa), exponent + full
    weights = np.random.default_rng(20040917).standard_normal((3, n))[:, rows.indices]
    values = np.stack([np.ones_like(mantissa), mantissa, exponent]) * weights
    marks = np.stack([np.bincount(_row_of(rows), v, m) for v in values])
    sizes = np.stack([np.bincount(_row_of(rows), np.abs(v), m) for v in values])
    order = np.lexsort(marks)
    near = np.abs(np.diff(marks[:, order], axis=1)) <= SAME * sizes[:, order][:, 1:]
    starts = np.concatenate([[True], ~near.all(axis=0)])
    group = np.empty(m, dtype=np.int64)
    group[order] = np.cumsum(starts) - 1
    return group, lead


def _row_of(rows: Any) -> Any:
    return np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))
