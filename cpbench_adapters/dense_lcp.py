"""Data of an LCP for guests with dense storage: M as one C-ordered array, and no more than fits."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.lcp import LCP
from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense

DENSE_BYTES = 4e9
"""Most memory that a guest's matrices may take."""


def too_large(problem: LCP, arrays: int) -> str | None:
    """Return why a guest that keeps so many dense n x n arrays does not get this problem, else None."""
    n = problem.q.size
    size = 8.0 * arrays * n * n
    if size <= DENSE_BYTES:
        return None
    return (
        f"keeps {arrays} dense {n}x{n} matrices: {size / 1e9:.1f} GB (at most {DENSE_BYTES / 1e9:.0f} GB); "
        "use a sparse solver"
    )


def dense_matrix(problem: LCP) -> Dense:
    """Return M in C order, read-only whether the problem is dense or sparse: one type for guests that compile for
    types."""
    M = np.ascontiguousarray(matrices.dense(problem.M))
    if M.flags.writeable:
        M.setflags(write=False)
    return M
