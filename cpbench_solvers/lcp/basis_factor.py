"""The factor of M_BB for an active set B, and what it says of the columns outside."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import lapack

from cpbench.foundation.matrices import Vector

ROUNDING = 1e-6
"""A residual of M_FF z_F = -q_F beyond this share of its largest term means that M_FF is as good as singular."""


class BasisFactor:
    """Cholesky's factor where M is symmetric and M_BB definite, else LU.

    Parameters
    ----------
    M : (n, n) in C's order. columns : its transpose, in C's order too. inside : (n,) which indices B has.

    Attributes
    ----------
    B : the indices. singular : an exact zero was met; `solve` answers nothing then. cholesky : whose factor it is.
    """

    def __init__(
        self, M: np.ndarray[Any, Any], columns: np.ndarray[Any, Any], symmetric: bool, inside: np.ndarray[Any, Any]
    ) -> None:
        self.inside, self.B = inside.copy(), np.flatnonzero(inside)
        self._M, self._columns = M, columns
        self.singular, self.cholesky = False, symmetric
        if self.B.size == 0:
            return
        if symmetric:
            self._factor, info = lapack.dpotrf(self._principal().T, lower=1, clean=0, overwrite_a=1)
            self.cholesky = info == 0
        if not self.cholesky:
            # the transpose of a C-ordered matrix is what LAPACK takes without a copy
            self._factor, self._interchanges, info = lapack.dgetrf(self._principal().T, overwrite_a=1)
            self.singular = info != 0

    @property
    def pivots(self) -> Vector:
        """Absolute values of the pivots of the elimination, shape (|B|,)."""
        if self.B.size == 0:
            return np.ones(0)
        diagonal = np.abs(self._factor.diagonal())
        return diagonal**2 if self.cholesky else diagonal

    def solve(self, right: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """Return M_BB⁻¹ right, right : (|B|,) or (|B|, k)."""
        if self.B.size == 0:
            return right
        if self.cholesky:
            return lapack.dpotrs(self._factor, right, lower=1)[0]
        return lapack.dgetrs(self._factor, self._interchanges, right, trans=1)[0]

    def border(self, indices: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """Return M_Bj for the indices j outside, e_j for those inside: (|B|, k) in Fortran's order."""
        U = np.zeros((self.B.size, indices.size), order="F")
        mine = self.inside[indices]
        U[:, ~mine] = self._columns.take(indices[~mine], axis=0).take(self.B, axis=1).T
        U[np.searchsorted(self.B, indices[mine]), np.flatnonzero(mine)] = 1.0
        return U

    def solution(self, q: Vector) -> tuple[Vector, Vector] | None:
        """Return z with M_BB z_B = -q_B, zero outside B, and w, zero on B; None where M_BB is singular."""
        z = np.zeros_like(q)
        if self.singular:
            return None
        z[self.B] = self.solve(-q[self.B])
        return judged_basic(self._M, q, z, self.B)

    def _principal(self) -> np.ndarray[Any, Any]:
        return self._M.take(self.B, axis=0).take(self.B, axis=1)


def judged_basic(
    M: np.ndarray[Any, Any], q: Vector, z: Vector, F: np.ndarray[Any, Any]
) -> tuple[Vector, Vector] | None:
    """Return z and w = Mz + q, zero on F, where M_FF z_F = -q_F holds to ROUNDING, else None."""
    w = M @ z
    largest = max(np.abs(q).max(initial=0.0), np.abs(w).max(initial=0.0))
    if not np.abs(w[F] + q[F]).max(initial=0.0) <= ROUNDING * largest:
        return None
    w += q
    w[F] = 0.0
    return z, w
