"""M_FF z_F = -q_F for active sets F that change little by little: one factorization, bordered for what has changed.

With the factor of M_BB, added indices A and removed ones R (z_R = 0, their equations get a slack) the system is

    [M_BB  M_BA  E_R] [z_B]   [-q_B]
    [M_AB  M_AA   0 ] [z_A] = [-q_A]
    [E_Rᵀ   0     0 ] [ μ ]   [  0 ]

and is solved by the Schur complement of M_BB: a column M_BB⁻¹[M_BA, E_R] for every change, kept while B is.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import lapack

from cpbench.foundation.matrices import Vector
from cpbench_solvers.lcp.basis_factor import BasisFactor, judged_basic


class ChangingBasis:
    """Basic solutions of the LCP (M, q); Cholesky's factor where M is symmetric and M_FF definite, else LU.

    Parameters
    ----------
    M : (n, n) in C's order. columns : its transpose, in C's order too.
    """

    def __init__(self, M: np.ndarray[Any, Any], columns: np.ndarray[Any, Any], q: Vector, symmetric: bool) -> None:
        self._M, self._by_columns, self._q, self._symmetric = M, columns, q, symmetric
        self._base: BasisFactor | None = None
        self._columns: dict[int, Vector] = {}
        self.factorizations = 0

    def solve(self, inside: np.ndarray[Any, Any]) -> tuple[Vector, Vector] | None:
        """Return z with M_FF z_F = -q_F, zero outside F = `inside`, and w, zero on F; None where M_FF is singular."""
        F = np.flatnonzero(inside)
        z = np.zeros_like(self._q)
        if F.size:
            x = self._bordered(inside, F.size)
            if x is None:
                x = self._afresh(inside)
            if x is None:
                return None
            z[F] = x
        return judged_basic(self._M, self._q, z, F)

    def _afresh(self, inside: np.ndarray[Any, Any]) -> Vector | None:
        self.factorizations += 1
        self._columns = {}
        self._base = base = BasisFactor(self._M, self._by_columns, self._symmetric, inside)
        if base.singular:
            self._base = None
            return None
        self._solution = base.solve(-self._q[base.B])
        return self._solution if np.isfinite(self._solution).all() else None

    def _bordered(self, inside: np.ndarray[Any, Any], size: int) -> Vector | None:
        """Return z_F, ordered as F; None without a factor of a near basis, or for a singular Schur complement."""
        factor, M = self._base, self._M
        if factor is None:
            return None
        base = factor.B
        changed = np.flatnonzero(inside != factor.inside)
        # a solve for a column and a factorization do the same work at |F|/6 columns, |F|/3 for LU; these are slower
        if changed.size > size // (8 if factor.cholesky else 4):
            return None
        if changed.size == 0:
            return self._solution
        new = np.array([i for i in changed.tolist() if i not in self._columns], dtype=np.int64)
        if new.size:
            solved = factor.solve(factor.border(new))
            self._columns.update(zip(new.tolist(), solved.T, strict=True))
        Y = np.stack([self._columns[i] for i in changed.tolist()], axis=1)
        removed = factor.inside[changed]
        A, R = changed[~removed], changed[removed]
        places = np.searchsorted(base, R)
        V = np.empty((changed.size, base.size))
        V[~removed] = M.take(A, axis=0).take(base, axis=1)
        V[removed] = 0.0
        V[np.flatnonzero(removed), places] = 1.0
        C = np.zeros((changed.size, changed.size))
        C[np.ix_(~removed, ~removed)] = M[np.ix_(A, A)]
        right = np.where(removed, 0.0, -self._q[changed]) - V @ self._solution
        _, _, y, info = lapack.dgesv(C - V @ Y, right)
        if info != 0 or not np.isfinite(y).all():
            return None
        x = np.zeros_like(self._q)
        x[base] = self._solution - Y @ y
        x[A] = y[~removed]
        return x[np.setdiff1d(np.union1d(base, A), R)]
