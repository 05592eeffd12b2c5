"""Facts of a matrix that make a solution unique, or a program convex, decided in exact arithmetic.

Doubles give the witness; integers decide. Both facts are of the problem, not of an answer.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from flint import fmpq_mat, fmpz_mat
from scipy.linalg import lapack, solve_triangular
from scipy.sparse.csgraph import connected_components

from cpbench.foundation.matrices import Sparse

LARGEST = 1200
"""Rows of the largest matrix that is looked at."""
P_MATRIX, DEFINITE, SEMIDEFINITE = "P-matrix", "positive definite", "positive semidefinite"


def uniqueness(M: Sparse, *, box: bool) -> str:
    """Name the fact by which a problem with this matrix has one solution at most, '' where none is found.

    A P-matrix is enough over a `box`; a definite matrix over every convex set.
    """
    if not 0 < M.shape[0] <= LARGEST:
        return ""
    return P_MATRIX if box and dominant(M) else DEFINITE if definite(M) else ""


def dominant(M: Sparse) -> bool:
    """Return whether M is an H-matrix with positive diagonal, hence a P-matrix.

    Exactly: Mᵢᵢwᵢ > Σ|Mᵢⱼ|wⱼ for some w > 0.

    (Berman, Plemmons: Nonnegative Matrices in the Mathematical Sciences, 1994, chapter 6.)
    """
    dense: Any = M.toarray()
    diagonal = np.diag(dense).copy()
    if not (diagonal > 0).all():
        return False
    compared = -np.abs(dense)
    np.fill_diagonal(compared, diagonal)
    try:
        w = np.linalg.solve(compared, diagonal)
    except np.linalg.LinAlgError:
        return False
    if not (np.isfinite(w).all() and (w > 0).all()):
        return False
    integers, weights = integer_matrix(compared), integer_matrix(w[:, None])
    return all(value > 0 for value in (integers * weights).entries())


def definite(M: Sparse) -> bool:
    """Return whether M + Mᵀ is positive definite: X(M + Mᵀ)Xᵀ is strictly diagonally dominant, exactly, for some X.

    X is the inverse of a Cholesky factor in doubles (after Rump: Verification of positive definiteness, BIT 46, 2006).
    Were X singular, the product would be so too, which a dominant matrix is not.
    """
    dense: Any = M.toarray()
    diagonal = np.diag(dense)
    if not (diagonal > 0).all():
        return False
    # powers of two, so that the scaled matrix is the same number for number
    scale = np.ldexp(1.0, -(np.frexp(diagonal)[1] // 2))
    scaled = dense * scale[:, None] * scale[None, :]
    if not np.isfinite(scaled).all() or ((scaled == 0) & (dense != 0)).any():
        return False
    try:
        factor = np.linalg.cholesky(scaled + scaled.T)
    except np.linalg.LinAlgError:
        return False
    inverse = solve_triangular(factor, np.eye(len(diagonal)), lower=True, check_finite=False)
    if not np.isfinite(inverse).all():
        return False
    X, half = integer_matrix(inverse, 40), integer_matrix(scaled)
    product: Any = X * (half + half.transpose()) * X.transpose()
    return all(2 * row[i] > sum(map(abs, row)) for i, row in enumerate(product.tolist()))


def convexity(Q: Sparse) -> str:
    """Name the fact that makes a symmetric matrix positive semidefinite, '' where none is found: each of its connected
    components is a number ≥ 0 or is shown to be so."""
    count, label = connected_components(sp.csr_matrix(Q), directed=False)
    if (Q.diagonal() < 0).any():
        return ""
    order = np.argsort(label, kind="stable")
    parts = np.split(order, np.cumsum(np.bincount(label, minlength=count))[:-1])
    larger = [sp.csr_array(Q[part][:, part]) for part in parts if part.size > 1]
    if all(M.shape[0] <= LARGEST and definite(M) for M in larger) and (Q.diagonal() > 0).all():
        return DEFINITE
    fits = all(M.shape[0] <= LARGEST and (definite(M) or semidefinite(M)) for M in larger)
    return SEMIDEFINITE if fits else ""


def semidefinite(M: Sparse) -> bool:
    """Return whether a symmetric matrix is positive semidefinite: a block of its rows and columns is positive definite,
    and by that block, exactly, nothing is left of the others (its Schur complement is 0)."""
    dense: Any = M.toarray()
    if (dense != dense.T).any():
        return False
    _, pivots, rank, _ = lapack.dpstrf(dense, tol=-1.0)
    some, others = pivots[:rank] - 1, pivots[rank:] - 1
    if not (0 < rank < len(dense) and definite(sp.csr_array(dense[np.ix_(some, some)]))):
        return False
    whole = integer_matrix(dense).tolist()

    def block(rows: Any, columns: Any) -> Any:
        return fmpq_mat(fmpz_mat([[whole[i][j] for j in columns.tolist()] for i in rows.tolist()]))

    rest = block(others, some) * block(some, some).solve(block(some, others), algorithm="dixon")
    return rest == block(others, others)


def integer_matrix(dense: Any, bits: int | None = None) -> Any:
    """Return the matrix times a power of two, exact; with `bits`, rounded to as many digits of its largest entry."""
    mantissas, exponents = np.frexp(dense)
    least = int(exponents[dense != 0].min()) - 53 if (dense != 0).any() else 0
    if bits is not None:
        least = int(np.frexp(np.abs(dense).max())[1]) - bits
        rounded = np.rint(np.ldexp(dense, -least)).astype(np.int64)
        return fmpz_mat(rounded.tolist())
    whole = (mantissas * 2.0**53).astype(np.int64).ravel().tolist()
    shifts = (exponents.astype(np.int64) - 53 - least).ravel().tolist()
    entries = [value << shift if value else 0 for value, shift in zip(whole, shifts, strict=True)]
    return fmpz_mat(*dense.shape, entries)
