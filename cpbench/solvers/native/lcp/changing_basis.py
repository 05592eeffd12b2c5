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

from cpbench.matrices import Vector, max_abs

ROUNDING = 1e-6
"""A residual of M_FF z_F = -q_F beyond this share of its largest term means that M_FF is as good as singular."""


class ChangingBasis:
    """Basic solutions of the LCP (M, q); Cholesky's factor where M is symmetric and M_FF definite, else LU.

    Parameters
    ----------
    M : (n, n) in C's order. columns : its transpose, in C's order too.

    Attributes
    ----------
    factorizations : made so far.
    """

    def __init__(self, M: np.ndarray[Any, Any], columns: np.ndarray[Any, Any], q: Vector, symmetric: bool) -> None:
        self._M, self._by_columns, self._q, self._symmetric = M, columns, q, symmetric
        self._inside = np.zeros(q.size, dtype=bool)
        self._columns: dict[int, Vector] = {}
        self._base: np.ndarray[Any, Any] | None = None
        self.factorizations = 0

    def solve(self, inside: np.ndarray[Any, Any]) -> tuple[Vector, Vector] | None:
        """z with M_FF z_F = -q_F, zero outside F = `inside`, and w, zero on F; None where M_FF is singular."""
        F = np.flatnonzero(inside)
        z = np.zeros_like(self._q)
        if F.size:
            changed = np.flatnonzero(inside != self._inside)
            # a solve for a column and a factorization do the same work at |F|/6 columns, |F|/3 for LU; these are slower
            few = F.size // (8 if self._cholesky else 4)
            x = None
            if self._base is not None and changed.size <= few:
                x = self._bordered(changed)
            if x is None:
                x = self._afresh(inside, F)
            if x is None:
                return None
            z[F] = x
        w = self._M @ z
        if not max_abs(w[F] + self._q[F]) <= ROUNDING * max(max_abs(self._q), max_abs(w)):
            return None
        w += self._q
        w[F] = 0.0
        return z, w

    def _afresh(self, inside: np.ndarray[Any, Any], F: np.ndarray[Any, Any]) -> Vector | None:
        self._inside, self._base, self._columns = inside.copy(), F, {}
        self.factorizations += 1
        self._cholesky = self._symmetric
        if self._symmetric:
            self._factor, info = lapack.dpotrf(self._principal(F).T, lower=1, clean=0, overwrite_a=1)
            self._cholesky = info == 0
        if not self._cholesky:
            # the transpose of a C-ordered matrix is what LAPACK takes without a copy
            self._factor, self._pivots, info = lapack.dgetrf(self._principal(F).T, overwrite_a=1)
            if info != 0:
                return None
        self._solution = self._base_solve(-self._q[F])
        return self._solution if np.isfinite(self._solution).all() else None

    def _principal(self, F: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        return self._M.take(F, axis=0).take(F, axis=1)

    _cholesky = False

    def _base_solve(self, right: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        if self._cholesky:
            return lapack.dpotrs(self._factor, right, lower=1)[0]
        return lapack.dgetrs(self._factor, self._pivots, right, trans=1)[0]

    def _bordered(self, changed: np.ndarray[Any, Any]) -> Vector | None:
        """z_F in the order of F; None where the Schur complement is singular."""
        base, M = self._base, self._M
        assert base is not None
        if changed.size == 0:
            return self._solution
        new = np.array([i for i in changed.tolist() if i not in self._columns], dtype=np.int64)
        if new.size:
            solved = self._base_solve(self._border(new))
            self._columns.update(zip(new.tolist(), solved.T, strict=True))
        Y = np.stack([self._columns[i] for i in changed.tolist()], axis=1)
        removed = self._inside[changed]
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

    def _border(self, indices: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
        """M_BA and E_R for the indices, in Fortran's order."""
        base = self._base
        assert base is not None
        U = np.zeros((base.size, indices.size), order="F")
        removed = self._inside[indices]
        U[:, ~removed] = self._by_columns.take(indices[~removed], axis=0).take(base, axis=1).T
        U[np.searchsorted(base, indices[removed]), np.flatnonzero(removed)] = 1.0
        return U
