"""Arrays of the mathematics: one dense form, one sparse form, both read-only, and facts about them.

A matrix is a 2-D ``float64`` array or a canonical ``csr_array`` (sorted indices, duplicates summed). What
comes in sparse stays sparse. Data of a problem are frozen, so they may be shared between problems, points
and traces without copies.
"""

from __future__ import annotations

import hashlib
from typing import Any, TypeAlias, cast

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import ArrayLike, NDArray

from cpbench.definite import is_definite, on_diagonal
from cpbench.errors import ProblemError

Vector: TypeAlias = NDArray[np.float64]
Dense: TypeAlias = NDArray[np.float64]
Sparse: TypeAlias = sp.csr_array
Matrix: TypeAlias = Dense | Sparse

PSD_TOLERANCE = 1e-8
"""A symmetric part counts as positive semidefinite when its least eigenvalue is above this times -max|M|."""
SYMMETRY_TOLERANCE = 1e-12
"""max|M - Mᵀ| / max|M| below which a matrix counts as symmetric."""
_MARK = "_cpbench_adopted"
"""Attribute of a CSR that keeps the arrays it was adopted with."""


# ------------------------------------------------------------------------------------------------ build


def vector(value: ArrayLike, label: str = "vector", *, finite: bool = True) -> Vector:
    """A read-only 1-D float64 copy of `value`; raises ProblemError on another shape, NaN or infinity."""
    _require_real(value, label)
    try:
        array = _native(np.array(value, dtype=np.float64, order="C"))
    except (TypeError, ValueError) as cause:
        raise ProblemError(label, f"not a vector of numbers ({cause})") from None
    if array.ndim != 1:
        raise ProblemError(label, f"must be a vector, has shape {array.shape}")
    if finite:
        _require_finite(array, label)
    return freeze(array)


def matrix(value: Any, label: str = "matrix") -> Matrix:
    """A read-only float64 copy of `value`: 2-D array, or canonical CSR when `value` is sparse."""
    _require_real(value, label)
    if sp.issparse(value):
        if _adopted(value):
            return cast(Sparse, value)
        csr = sp.csr_array(value, dtype=np.float64, copy=True)
        csr.sum_duplicates()
        csr.data = _native(csr.data)
        _require_finite(csr.data, label)
        return adopt(csr)
    try:
        array = _native(np.array(value, dtype=np.float64, order="C"))
    except (TypeError, ValueError) as cause:
        raise ProblemError(label, f"not a matrix of numbers ({cause})") from None
    if array.ndim != 2:
        raise ProblemError(label, f"must be a matrix, has shape {array.shape}")
    _require_finite(array, label)
    return freeze(array)


def adopt(csr: Sparse) -> Sparse:
    """Freeze a CSR of one's own making, which `matrix` then takes without a copy or a look at its numbers.

    The caller promises float64, sorted indices, no duplicates, finite entries, and that nobody else writes to them.
    """
    csr.has_canonical_format = True
    freeze_sparse(csr)
    setattr(csr, _MARK, (csr.data, csr.indices, csr.indptr))
    return csr


def settle(csr: Sparse) -> Sparse:
    """`adopt` for a CSR whose arrays are the caller's alone, where it keeps that promise; else as it is."""
    plain = csr.dtype == np.float64 and csr.data.dtype.isnative
    return adopt(csr) if plain and csr.has_canonical_format and _all_finite(csr.data) else csr


def _adopted(value: Any) -> bool:
    """Whether `adopt` has seen these very arrays, and nobody has thawed or replaced them since."""
    seen = getattr(value, _MARK, None)
    if seen is None or not isinstance(value, sp.csr_array):
        return False
    now = (value.data, value.indices, value.indptr)
    return all(a is b and not a.flags.writeable for a, b in zip(seen, now, strict=True))


def _native(array: NDArray[Any]) -> NDArray[Any]:
    """The same numbers under the plain dtype: arrays from files may keep a '<f8' that equals float64, but whose
    buffer some guests (CVXOPT) refuse."""
    return array.view(np.float64)


def freeze(array: NDArray[Any]) -> NDArray[Any]:
    array.setflags(write=False)
    return array


def freeze_sparse(csr: Sparse) -> Sparse:
    for part in (csr.data, csr.indices, csr.indptr):
        part.setflags(write=False)
    return csr


def _all_finite(array: NDArray[Any]) -> bool:
    with np.errstate(over="ignore", invalid="ignore"):
        # a sum is finite only if its terms are, and takes no memory; one that overflows has to be looked at
        return bool(np.isfinite(array.sum()) or np.isfinite(array).all())


def _require_real(value: Any, label: str) -> None:
    """A conversion to float64 would drop imaginary parts with no more than a warning."""
    if np.iscomplexobj(value):
        raise ProblemError(label, "has complex numbers, must be real")


def _require_finite(array: NDArray[Any], label: str) -> None:
    if not _all_finite(array):
        bad = ~np.isfinite(array)
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        place = where[0] if len(where) == 1 else where
        raise ProblemError(label, f"has {int(bad.sum())} non-finite entries, the first at {place}")


# ---------------------------------------------------------------------------------------------- reshape


def is_sparse(M: Matrix) -> bool:
    return sp.issparse(M)


def dense(M: Matrix) -> Dense:
    """`M` as a 2-D array (a view when it is one already)."""
    return np.asarray(M.toarray()) if sp.issparse(M) else M  # pyright: ignore


def sparse(M: Matrix) -> Sparse:
    """`M` as CSR (itself when it is one already)."""
    return M if isinstance(M, sp.csr_array) else sp.csr_array(M)  # pyright: ignore


def transpose(M: Matrix) -> Matrix:
    """Mᵀ: a view when dense, CSR when sparse."""
    return sp.csr_array(M.T) if sp.issparse(M) else M.T


def block(rows: list[list[Matrix | None]]) -> Matrix:
    """[[A, B], [C, D]] from blocks: dense when every block is, CSR as soon as one is sparse."""
    if any(sp.issparse(b) for row in rows for b in row):
        return sp.csr_array(sp.block_array(cast(Any, rows), format="csr"))
    return np.block(cast(Any, rows))


def zeros(rows: int, cols: int, like: Matrix) -> Matrix:
    return sp.csr_array((rows, cols), dtype=np.float64) if sp.issparse(like) else np.zeros((rows, cols))


def identity(n: int, like: Matrix) -> Matrix:
    return sp.csr_array(sp.eye_array(n, format="csr")) if sp.issparse(like) else np.eye(n)


def index_dtype(*sizes: int) -> type[np.signedinteger[Any]]:
    """int32 unless one of the numbers that an index or a count may reach does not fit."""
    return np.int64 if max(sizes, default=0) > np.iinfo(np.int32).max else np.int32


def scaled_both(M: Matrix, s: Vector) -> Matrix:
    """diag(s) M diag(s), stored as M is; symmetric to the last bit where M is."""
    if not is_sparse(M):
        return dense(M) * np.outer(s, s)
    D = sp.dia_array((s[None, :], [0]), shape=(s.size, s.size))
    return sp.csr_array(D @ M @ D)


def nnz(M: Matrix) -> int:
    """Stored entries of a sparse matrix, nonzero ones of a dense one."""
    return int(M.nnz) if sp.issparse(M) else int(np.count_nonzero(M))


def digest(M: Matrix | Vector) -> bytes:
    """A content hash that does not see how a matrix is stored (dense or sparse, explicit zeros)."""
    h = hashlib.sha256()
    if isinstance(M, np.ndarray) and M.ndim == 1:
        h.update(f"vector {M.size};".encode())
        h.update(np.ascontiguousarray(M + 0.0).tobytes())  # + 0.0 turns -0 into 0
        return h.digest()
    csr = sp.csr_array(M, copy=True)
    csr.sum_duplicates()
    csr.eliminate_zeros()
    h.update(f"matrix {csr.shape[0]} {csr.shape[1]};".encode())
    h.update(csr.indptr.astype(np.int64).tobytes())
    h.update(csr.indices.astype(np.int64).tobytes())
    h.update(np.ascontiguousarray(csr.data).tobytes())
    return h.digest()


# ------------------------------------------------------------------------------------------------ facts


def max_abs(M: Matrix | Vector) -> float:
    data = M.data if sp.issparse(M) else np.asarray(M)
    return float(np.abs(data).max()) if data.size else 0.0


def norm(x: Vector) -> float:
    return float(np.linalg.norm(x))


def asymmetry(M: Matrix) -> float:
    """max|M - Mᵀ| / max|M|, 0 for the zero matrix."""
    top = max_abs(M)
    return max_abs(cast(Matrix, M - M.T)) / top if top > 0 else 0.0


def is_symmetric(M: Matrix, tolerance: float = SYMMETRY_TOLERANCE) -> bool:
    return M.shape[0] == M.shape[1] and asymmetry(M) <= tolerance


def is_psd(M: Matrix, tolerance: float = PSD_TOLERANCE) -> bool:
    """Whether the least eigenvalue of (M + Mᵀ)/2 is above -tolerance·max|M|.

    Decided by a factorization of the symmetric part shifted by that amount: Cholesky when dense, SuperLU on
    diagonal pivots when sparse (all pivots positive means positive definite).
    """
    n = M.shape[0]
    top = max_abs(M)
    if n == 0 or top == 0.0:
        return True
    shift = max(tolerance, 4 * n * np.finfo(float).eps) * top
    if sp.issparse(M) and n > 300:
        shifted = sp.csc_array((M + M.T) * 0.5 + shift * sp.eye_array(n))
        return is_definite(on_diagonal(shifted))
    D = dense(M)
    S = (D + D.T) * 0.5
    S[np.diag_indices(n)] += shift
    try:
        sla.cholesky(S, lower=True, overwrite_a=True, check_finite=False)
    except sla.LinAlgError:
        return False
    return True


def least_eigenvalue(M: Matrix) -> float:
    """Least eigenvalue of (M + Mᵀ)/2, for messages; a bound from above by Lanczos where M is sparse and large."""
    S = (M + M.T) * 0.5
    if S.shape[0] == 0:
        return 0.0
    if not sp.issparse(S) or S.shape[0] <= 300:
        return float(np.linalg.eigvalsh(dense(S))[0])
    start = np.random.default_rng(0).standard_normal(S.shape[0])  # the message must not change from run to run
    try:
        values = spla.eigsh(S, k=1, which="SA", v0=start, tol=1e-2, maxiter=300, return_eigenvectors=False)
        return float(values[0])
    except spla.ArpackNoConvergence as partial:
        x: Vector = np.real(partial.eigenvectors[:, 0]) if len(partial.eigenvalues) else start
        return float(x @ (S @ x)) / float(x @ x)


def rank(M: Matrix) -> int:
    """Numerical rank by singular values of the equilibrated matrix (dense; for messages about small blocks)."""
    if not min(M.shape):
        return 0
    D = dense(M)
    for axis in (1, 0):
        D = D * power_of_two(np.abs(D).max(axis=axis, keepdims=True))
    return int(np.linalg.matrix_rank(D))


def power_of_two(top: Vector) -> Vector:
    """The powers of 2 that bring the positive numbers `top` into [1/2, 1), and 1 for 0."""
    return np.ldexp(1.0, -np.frexp(top)[1])
