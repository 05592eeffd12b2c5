"""Messages on a matrix that makes a problem nonconvex, and a promise weaker."""

from __future__ import annotations

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Matrix

LARGEST = 1000
"""Rows up to which the least eigenvalue is computed for a message (0.1 s)."""


def indefinite(M: Matrix, name: str) -> str:
    """Return the message that `M` is not positive semidefinite, with its least eigenvalue where that is cheap."""
    n = M.shape[0]
    number = f"n = {n}"
    if n <= LARGEST:
        number = f"least eigenvalue at unit diagonal {matrices.least_eigenvalue(M):.1e} or less"
    return f"the symmetric part of {name} is not positive semidefinite, {number}"
