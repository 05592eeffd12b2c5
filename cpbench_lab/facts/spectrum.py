"""Symmetry, definiteness and rank, by what the size allows.

Small matrices have their eigenvalues or singular values computed. Large ones are factored when their bandwidth promises
that it is cheap, as that of separate bodies does; of others nothing is said.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
import scipy.sparse.csgraph as csgraph

from cpbench.foundation import matrices
from cpbench.foundation.matrices import (
    PSD_TOLERANCE,
    SYMMETRY_TOLERANCE,
    Matrix,
    Vector,
    all_pivots_positive,
    factor_on_diagonal,
)
from cpbench_lab.facts.fact import Fact, How, undecided

EIGEN_LIMIT = 1000
"""Largest matrix whose eigenvalues or singular values are computed (under a second)."""
CHOLESKY_LIMIT = 4000
"""Largest dense matrix that is factored."""
SPARSE_WORK = 2e10
"""Bound on n·bandwidth² of a sparse matrix that is factored."""
PRODUCT_WORK = 1e9
"""Bound on the multiplications of a Gram matrix."""
EPS = float(np.finfo(float).eps)
SCALED = "after scaling to unit diagonal"


def symmetry(M: Matrix, name: str) -> Fact:
    """Compare `matrices.asymmetry` with SYMMETRY_TOLERANCE; M square."""
    skew = matrices.asymmetry(M)
    evidence = "largest |M_ij−M_ji| over max(√|M_ii M_jj|, |M_ij|, |M_ji|) ="
    return Fact("symmetry", name, skew <= SYMMETRY_TOLERANCE, How.EXACT, skew, SYMMETRY_TOLERANCE, evidence)


def definiteness(M: Matrix, name: str) -> Fact:
    """Decide the definiteness of (M + Mᵀ)/2, M square, by S = `matrices.unit_diagonal(M)`, of which all numbers are.

    `positive definite` beyond rounding (n·ε·‖S‖); `positive semidefinite` when the least eigenvalue is above
    −PSD_TOLERANCE, the rule of `matrices.is_psd`; else `indefinite` or `negative semidefinite`.
    """
    n = M.shape[0]
    label, tolerance = "definiteness", max(PSD_TOLERANCE, 4 * n * EPS)
    if n == 0:
        return Fact(label, name, "positive definite", How.EXACT, evidence="no rows")
    with np.errstate(over="ignore", invalid="ignore"):
        S: Any = matrices.unit_diagonal(M)
    if not np.isfinite(matrices.max_abs(S)):
        return undecided(label, name, f"entries overflow {SCALED}")
    if n <= EIGEN_LIMIT:
        values = np.linalg.eigvalsh(matrices.dense(S))
        rounding = n * EPS * float(np.abs(values).max())
        word = _word(float(values.min()), float(values.max()), rounding, tolerance)
        limit = rounding if word == "positive definite" else tolerance
        return Fact(label, name, word, How.FACTORIZATION, float(values.min()), limit, f"least eigenvalue {SCALED}")
    diagonal = S.diagonal()
    if diagonal.min() < -tolerance and diagonal.max() > tolerance:
        i = int(diagonal.argmin())
        return Fact(label, name, "indefinite", How.EXACT, float(M[i, i]), evidence=f"diagonal entry {i + 1} is")
    radius = abs(S).sum(axis=1) - np.abs(diagonal)
    bound = float((diagonal - radius).min())
    if bound > n * EPS:
        return Fact(
            label, name, "positive definite", How.EXACT, bound, evidence=f"every eigenvalue {SCALED} is at least"
        )
    if affordable(S):
        rounding = n * EPS * float(abs(S).sum(axis=1).max())
        for word, shift in (("positive definite", -rounding), ("positive semidefinite", tolerance)):
            solve = _positive_factor(S, shift)
            if solve is not None:
                least = _inverse_iteration(S, solve)
                return Fact(
                    label, name, word, How.FACTORIZATION, least, abs(shift), f"least eigenvalue {SCALED} at most"
                )
        word = (
            "indefinite" if diagonal.max() > 0 or _positive_factor(-S, tolerance) is None else "negative semidefinite"
        )
        return Fact(label, name, word, How.FACTORIZATION, None, tolerance, f"a pivot {SCALED} is negative")
    return undecided(label, name, f"n = {n} with {matrices.nnz(S)} nonzeros is too large to factor")


def rank(M: Matrix, name: str, *, known: Fact | None = None) -> Fact:
    """Count singular values above rounding; `known` is the definiteness of a square M, which may settle it."""
    rows, cols = M.shape
    label, full = "rank", min(M.shape)
    if full == 0 or matrices.max_abs(M) == 0.0:
        return Fact(label, name, 0, How.EXACT, evidence="no nonzero entry")
    if known is not None and known.value == "positive definite":
        return Fact(label, name, full, known.how, evidence="full, the symmetric part is positive definite")
    if float(rows) * cols * full <= EIGEN_LIMIT**3:
        values = np.linalg.svd(matrices.dense(M), compute_uv=False)
        tolerance = max(rows, cols) * EPS * float(values.max())
        kept = values[values > tolerance]
        if not kept.size:  # the matrix is not 0, so that the largest is not a finite number
            return undecided(label, name, "singular values overflow")
        return Fact(
            label, name, int(kept.size), How.FACTORIZATION, float(kept.min()), tolerance, "least singular value kept"
        )
    gram = _gram(M, known)
    if gram is not None:
        G, what, relative = gram
        threshold = relative * float(abs(G).sum(axis=1).max())
        lu = _symmetric_lu(G, -threshold)
        if lu is not None:  # the pivots have the signs of the eigenvalues (Sylvester)
            rank = int((lu.U.diagonal() > 0).sum())
            return Fact(
                label, name, rank, How.FACTORIZATION, tolerance=threshold, evidence=f"eigenvalues of {what} above it"
            )
    return undecided(label, name, f"{rows}x{cols} with {matrices.nnz(M)} nonzeros is too large to factor")


def _word(least: float, largest: float, rounding: float, tolerance: float) -> str:
    if least > rounding:
        return "positive definite"
    if least >= -tolerance:
        return "positive semidefinite"
    return "indefinite" if largest > tolerance else "negative semidefinite"


def affordable(S: Matrix) -> bool:
    """Return whether S is factored: by size when dense, by the bandwidth of reverse Cuthill–McKee when sparse."""
    n = S.shape[0]
    if not matrices.is_sparse(S):
        return n <= CHOLESKY_LIMIT
    if n <= EIGEN_LIMIT:
        return True
    csr = matrices.sparse(S)
    order = csgraph.reverse_cuthill_mckee(csr, symmetric_mode=True)
    place = np.empty(n, dtype=np.int64)
    place[order] = np.arange(n)
    coo = csr.tocoo()
    width = float(np.abs(place[coo.row] - place[coo.col]).max(initial=0))
    return n * width**2 <= SPARSE_WORK


def _symmetric_lu(S: Matrix, shift: float) -> Any | None:
    lu = factor_on_diagonal(S + shift * sp.eye_array(S.shape[0]))
    return lu if lu is not None and (lu.perm_r == lu.perm_c).all() else None


def _positive_factor(S: Matrix, shift: float) -> Callable[[Vector], Vector] | None:
    """Return x ↦ (S + shift·I)⁻¹x where S + shift·I is positive definite, else None."""
    if matrices.is_sparse(S):
        lu = _symmetric_lu(S, shift)
        return lu.solve if lu is not None and all_pivots_positive(lu) else None
    try:
        factor = sla.cho_factor(matrices.dense(S) + shift * np.eye(S.shape[0]), lower=True, check_finite=False)
    except sla.LinAlgError:
        return None
    return lambda x: sla.cho_solve(factor, x, check_finite=False)


def _inverse_iteration(S: Matrix, solve: Callable[[Vector], Vector]) -> float:
    """Return a Rayleigh quotient near the least eigenvalue, never below it."""
    x = np.random.default_rng(0).standard_normal(S.shape[0])
    for _ in range(20):
        y = solve(x / np.linalg.norm(x))
        if not np.isfinite(y).all():
            break
        x = y
    return float(x @ (S @ x)) / float(x @ x)


def _gram(M: Matrix, known: Fact | None) -> tuple[Any, str, float] | None:
    """Return a sparse semidefinite matrix of M's rank that is cheap to factor, its name, and the relative threshold."""
    if not matrices.is_sparse(M):
        return None
    semidefinite = known is not None and known.value == "positive semidefinite" and matrices.is_symmetric(M)
    if semidefinite:
        return (M, "the matrix", 1e-10) if affordable(M) else None
    wide = M if M.shape[0] <= M.shape[1] else matrices.transpose(M)
    if float((np.diff(sp.csc_array(wide).indptr).astype(float) ** 2).sum()) > PRODUCT_WORK:
        return None
    G = sp.csr_array(wide @ wide.T)
    return (G, "its Gram matrix", 1e-12) if affordable(G) else None
