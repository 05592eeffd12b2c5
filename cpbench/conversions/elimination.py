"""Products with an inverse, D A⁻¹ C, for the edges that eliminate unknowns (Schur complement, Delassus operator).

Sparse stays sparse. A matrix falls apart into the connected components of its graph (bodies of a mechanical
system, nodes of a circuit), and so does the product. Small components are dense blocks (`delassus`). Large ones are
factored by SuperLU, and the columns of C that touch them are solved for in bundles, so that no more than some dense
columns exist at a time; or by LAPACK, where that costs less.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg import blas

from cpbench.conversions import delassus
from cpbench.conversions.base import Conversion, Size
from cpbench.formulations.base import Kind
from cpbench.foundation import factorization, matrices
from cpbench.foundation.factorization import Factorization
from cpbench.foundation.matrices import Dense, Matrix, Sparse, Vector

BUNDLE = 64
"""Right-hand sides of one sparse solve: more of them leave the cache."""
FEW = 300
"""Rows and columns of a product that is computed by dense matrices where A is factored as one."""
SECONDS = {"dense": 2.5e-11, "bundle": 3.5e-10, "unknown": 1.8e-8}
"""Measured: a flop of LAPACK; an entry of L and U, and an unknown, a right-hand side of SuperLU."""
RATIO = 4
"""How many times as many unknowns as are touched, and columns as right-hand sides, make it pay to eliminate the others
first."""
WORSE = 0.01
"""Share of the reciprocal condition number that is given up for it."""
FULL = 0.5
"""Share of nonzero entries above which a product is kept dense: CSR would then need as much memory."""
DENSE_BYTES = 2**30
"""Most memory of an A made dense."""
LOSSLESS = 1e-8
"""Rounding of a target's data, relative, up to which the solutions of source and target count as the same: two digits
below the default tolerance."""
EPS = float(np.finfo(float).eps)
RANK_LIMIT = 500
"""Largest matrix whose rank a refusal gives (it takes a singular value decomposition)."""


class Elimination(Conversion):
    """Base of edges that eliminate unknowns by a matrix, as exact as its condition number allows.

    Attributes
    ----------
    eliminated : what the matrix is called in messages.
    """

    kind: ClassVar[Kind] = Kind.ONE_WAY
    best_kind = Kind.EQUIVALENT
    eliminated: ClassVar[str]

    def rcond(self, problem: Any) -> float:
        """Return the reciprocal condition number of the matrix."""
        return problem.factorization.rcond

    def exactness(self, problem: Any) -> Kind:
        """Return equivalent where rounding, of the order of eps/rcond, is at most LOSSLESS; else one-way."""
        return Kind.EQUIVALENT if LOSSLESS * self.rcond(problem) >= EPS else Kind.ONE_WAY

    def reservation(self, problem: Any) -> str:
        rcond = self.rcond(problem)
        condition, lost = (f"{1 / rcond:.1e}", f"{EPS / rcond:.0e}") if rcond > 0 else ("infinite", "all")
        return (
            f"the condition number of {self.eliminated} is {condition}, so that rounding may change the target by "
            f"{lost} of its size, more than {LOSSLESS:.0e}: it may lose solutions"
        )


def product(left: Matrix, factor: Factorization, right: Matrix) -> Matrix:
    """Return left · A⁻¹ · right for a nonsingular A; shapes (m, n), (n, n), (n, k).

    Dense when one of the three is (A⁻¹ is never formed); otherwise CSR, or dense when it fills up.
    """
    if not all(matrices.is_sparse(part) for part in (left, factor.A, right)):
        return _dense_product(matrices.dense(left), factor, matrices.dense(right))
    return compact(_sparse_product(_canonical(left), factor, _canonical(right)))


def congruence(H: Matrix, factor: Factorization) -> Matrix:
    """Return HᵀA⁻¹H for a nonsingular A; shapes (n, k), (n, n). Symmetric to the last bit when A is symmetric.

    Half the work of `product` where A is positive definite too.
    """
    if not factor.symmetric:
        return product(matrices.transpose(H), factor, H)
    if not (matrices.is_sparse(H) and matrices.is_sparse(factor.A)):
        return _dense_congruence(matrices.dense(H), factor)
    if factor.n > factorization.DENSE_LIMIT and factor.block_diagonal:
        W = delassus.congruence(_canonical(H), factor)
        if W is not None:
            return compact(W)
    W = _sparse_product(_canonical(matrices.transpose(H)), factor, _canonical(H))
    return symmetrised(W)


def schur(B: Matrix, D: Matrix, factor: Factorization, C: Matrix) -> Matrix:
    """Return the Schur complement B − D A⁻¹ C for a nonsingular A; shapes (m, k), (m, n), (n, n), (n, k)."""
    if factor.n == 0 or 0 in B.shape:
        return compact(B)
    if not any(matrices.is_sparse(part) for part in (B, D, factor.A, C)):
        left, right = _sides(D, factor, C)
        # by rows for us is by columns for BLAS: Bᵀ − rightᵀ leftᵀ, B copied once and nothing transposed in memory
        (a, trans_a), (b, trans_b) = _transposed(right), _transposed(left)
        return blas.dgemm(-1.0, a, b, beta=1.0, c=B.T, trans_a=trans_a, trans_b=trans_b).T
    less = product(D, factor, C)
    if matrices.is_sparse(less):
        return compact(B - less)
    np.negative(less, out=less)
    if matrices.is_sparse(B):
        entries = matrices.sparse(B).tocoo()
        less[entries.row, entries.col] += entries.data
    else:
        less += B
    return less


def less(constants: Vector, left: Matrix, factor: Factorization, right: Vector) -> Vector:
    """Return constants − left · A⁻¹ · right; 0 where these cancel but for the rounding of their terms, eps/rcond.

    A slack or a price that is 0 at the solution for no multiplier comes out as such a rest. As the only constant that
    no bound balances, it would be what the target's answers are measured by, and what its solution is made of.
    """
    solved = factor.solve(right)
    rest, terms = constants - left @ solved, np.abs(constants) + abs(left) @ np.abs(solved)
    return np.where(factor.rcond * np.abs(rest) <= EPS * terms, 0.0, rest)


def size_bound(left: Matrix, factor: Factorization, right: Matrix, added: int = 0) -> Size:
    """Bound the size of what `product` will make, with `added` entries of a matrix that it is taken from.

    Every row of left meets every column of right that touches the same component of A.
    """
    rows, cols = left.shape[0], right.shape[1]
    entries = rows * cols
    if all(matrices.is_sparse(part) for part in (left, factor.A, right)) and factor.n:
        labels, sizes = factorization.components(matrices.sparse(factor.A))
        met = _touched(matrices.sparse(left), labels, sizes.size) * _touched(
            matrices.sparse(matrices.transpose(right)), labels, sizes.size
        )
        entries = min(entries, int(met.sum()) + added)
    if entries > FULL * rows * cols:
        return Size.dense(rows, cols)
    return Size.sparse(rows, cols, entries)


def _touched(M: Sparse, labels: NDArray[Any], count: int) -> NDArray[np.float64]:
    """Return how many rows of M have an entry in each component."""
    row = np.repeat(np.arange(M.shape[0], dtype=np.int64), np.diff(M.indptr))
    pairs = np.unique(row * count + labels[M.indices])
    return np.bincount(pairs % count, minlength=count).astype(np.float64)


def compact(M: Matrix) -> Matrix:
    """Return CSR, or the dense array when more than half of the entries is nonzero."""
    if not matrices.is_sparse(M):
        return M
    return matrices.dense(M) if matrices.nnz(M) > FULL * M.shape[0] * M.shape[1] else matrices.sparse(M)


def symmetrised(W: Matrix) -> Matrix:
    """Return (W + Wᵀ)/2 of a matrix that is symmetric but for rounding, which solvers that ask for symmetry would
    refuse.

    (x + y)/2 = (y + x)/2 in floating point too, so the mean is symmetric to the last bit.
    """
    return compact((W + matrices.transpose(W)) * 0.5)


def singularity(factor: Factorization, what: str, instead: str) -> str | None:
    """Return the obstacle of an edge that needs `factor`'s matrix, called `what`, to be nonsingular; None when it
    is.
    """
    if not factor.singular:
        return None
    n = factor.n
    rank = f", rank {matrices.rank(factor.A)}" if n <= RANK_LIMIT else ""
    condition = f"{1 / factor.rcond:.1e}" if factor.rcond > 0 else "infinite"
    return f"{what} ({n}x{n}{rank}) is numerically singular, condition number {condition}; {instead}"


def _sides(left: Dense, factor: Factorization, right: Dense) -> tuple[Dense, Dense]:
    """Return two factors of left A⁻¹ right: A is solved with from the side that has fewer vectors."""
    if left.shape[0] < right.shape[1]:
        return factor.solve(left.T, transpose=True).T, right
    return left, factor.solve(right)


def _transposed(M: Dense) -> tuple[Dense, bool]:
    """Return mᵀ as BLAS takes it without a copy: an array by columns, and whether it is to be transposed."""
    return (M, True) if M.flags.f_contiguous else (M.T, False)


def _dense_product(left: Dense, factor: Factorization, right: Dense) -> Dense:
    if left.size == 0 or right.size == 0:
        return np.zeros((left.shape[0], right.shape[1]))
    first, second = _sides(left, factor, right)
    return first @ second


def _dense_congruence(H: Dense, factor: Factorization) -> Dense:
    """Compute GᵀG with G = L⁻¹H where A = LLᵀ (NumPy computes one half of it); else the mean of the product and its
    mirror.
    """
    if H.size == 0:
        return np.zeros((H.shape[1], H.shape[1]))
    try:
        lower = np.linalg.cholesky(matrices.dense(factor.A))
    except np.linalg.LinAlgError:
        return matrices.dense(symmetrised(_dense_product(H.T, factor, H)))
    G = blas.dtrsm(1.0, lower.T, H, trans_a=1)  # L lies by rows, so that BLAS sees the upper Lᵀ
    return G.T @ G


def _sparse_product(left: Sparse, factor: Factorization, right: Sparse) -> Matrix:
    shape = (left.shape[0], right.shape[1])
    if not (factor.n and left.nnz and right.nnz):
        return sp.csr_array(shape, dtype=np.float64)
    if factor.n <= factorization.DENSE_LIMIT and max(shape) <= FEW:
        return sp.csr_array(_dense_product(left.toarray(), factor, right.toarray()))
    if factor.block_diagonal:
        return delassus.product(left, factor, right)
    large = np.flatnonzero(~_small(factor))
    if 2 * large.size > factor.n:  # the small ones are not worth another factorization
        return _over_large(left, factor, right)
    part = Factorization(matrices.sparse(matrices.sparse(factor.A)[large][:, large]))
    result = _over_large(matrices.sparse(left[:, large]), part, matrices.sparse(right[large]))
    return result + delassus.product(left, factor, right)


def _canonical(M: Matrix) -> Sparse:
    """Return M sorted and without duplicates, as the kernels need it."""
    csr = matrices.sparse(M)
    if not csr.has_canonical_format:
        csr = sp.csr_array(csr, copy=True)
        csr.sum_duplicates()
    return csr


def _small(factor: Factorization) -> NDArray[np.bool_]:
    """Return which unknowns are in small components."""
    small = np.zeros(factor.n, dtype=bool)
    for block in factor.blocks:
        small[block.unknowns] = True
    return small


def _over_large(left: Sparse, factor: Factorization, right: Sparse) -> Matrix:
    """Compute the product by one factor of A, on the rows of `left` and columns of `right` that hold an entry."""
    shape = (left.shape[0], right.shape[1])
    rows, columns = np.flatnonzero(np.diff(left.indptr)), np.unique(right.indices)
    if (rows.size, columns.size) != shape:
        left, right = matrices.sparse(left[rows]), matrices.sparse(right[:, columns])
    result = _by_touched(left, factor, right)
    if result is None and _full_costs_less(left, factor, right):
        result = _by_lapack(left, factor, right)
    elif result is None:
        result = _by_bundles(left, factor, right)
    if (rows.size, columns.size) == shape:
        return result
    entries = sp.coo_array(result)
    return sp.csr_array((entries.data, (rows[entries.row], columns[entries.col])), shape=shape)


def _by_touched(left: Sparse, factor: Factorization, right: Sparse) -> Matrix | None:
    """Eliminate the unknowns that neither `left` nor `right` touches first; None where that does not pay.

    Without the touched unknowns a chain or a tree falls into many parts, each beside few of them: one dense right-hand
    side serves a column of every part.
    """
    is_touched = np.zeros(factor.n, dtype=bool)
    is_touched[left.indices] = True
    is_touched[np.flatnonzero(np.diff(right.indptr))] = True
    touched, rest = np.flatnonzero(is_touched), np.flatnonzero(~is_touched)
    if RATIO * touched.size > factor.n or not rest.size:
        return None
    A = matrices.sparse(factor.A)
    inner = matrices.sparse(A[rest][:, rest])
    into, back = A[rest][:, touched].tocoo(), A[touched][:, rest].tocoo()
    part, _ = factorization.components(inner)
    code = part[into.row] * np.int64(touched.size) + into.col
    beside = np.unique(code)  # each part with each column that it is beside
    first = np.searchsorted(beside // touched.size, np.arange(part.max(initial=0) + 2))
    width = int(np.diff(first).max(initial=0))
    if RATIO * width > right.shape[1]:
        return None
    parts = Factorization(inner)
    if parts.rcond < WORSE * factor.rcond:
        return None
    bundle = np.zeros((rest.size, width))
    bundle[into.row, np.searchsorted(beside, code) - first[part[into.row]]] = into.data
    solved = parts.solve(bundle)
    position = first[part[back.col]][:, None] + np.arange(width)
    here = position < first[part[back.col] + 1][:, None]
    terms = (back.data[:, None] * solved[back.col])[here]
    at = np.broadcast_to(back.row[:, None], here.shape)[here], beside[position[here]] % touched.size
    less = sp.csr_array((terms, at), shape=(touched.size, touched.size))
    outer = Factorization(matrices.sparse(A[touched][:, touched] - less))
    return _sparse_product(matrices.sparse(left[:, touched]), outer, matrices.sparse(right[touched]))


def _full_costs_less(left: Sparse, factor: Factorization, right: Sparse) -> bool:
    """Tell whether LAPACK on a dense A costs less than the right-hand sides of SuperLU."""
    n, columns = factor.n, right.shape[1]
    if 8 * n * n > DENSE_BYTES:
        return False
    flops = 2 / 3 * n**3 + 2.0 * n * n * columns + 2.0 * n * left.shape[0] * columns
    return SECONDS["dense"] * flops < columns * (SECONDS["bundle"] * factor.entries + SECONDS["unknown"] * n)


def _by_lapack(left: Sparse, factor: Factorization, right: Sparse) -> Dense:
    return left @ Factorization(matrices.dense(factor.A)).solve(right)


def _by_bundles(left: Sparse, factor: Factorization, right: Sparse) -> Matrix:
    """Multiply some hundred columns of `right` at a time, as dense vectors."""
    into = right.tocsc()
    bundles = (into[:, start : start + BUNDLE].toarray() for start in range(0, right.shape[1], BUNDLE))
    pieces: list[Any] = [_sparse_unless_full(left @ factor.solve(bundle)) for bundle in bundles]
    if any(matrices.is_sparse(piece) for piece in pieces):
        return sp.csr_array(sp.hstack(pieces, format="csr"))
    return np.hstack(pieces)


def _sparse_unless_full(M: Dense) -> Matrix:
    return M if matrices.nnz(M) > FULL * M.size else sp.csr_array(M)
