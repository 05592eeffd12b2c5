"""Factorizations of square matrices that are made once, survive pickling, and tell how singular they are."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, TypeAlias, cast

import numpy as np
import scipy.sparse as sp
import scipy.sparse.csgraph as csgraph
import scipy.sparse.linalg as spla
from numpy.typing import NDArray
from scipy.linalg import lapack

from cpbench.errors import ProblemError
from cpbench.foundation.matrices import (
    SYMMETRY_TOLERANCE,
    Dense,
    Matrix,
    Sparse,
    Vector,
    block_asymmetry,
    dense,
    is_symmetric,
    memory_errors,
    nnz,
    power_of_two,
    sparse,
)

SINGULAR_RCOND = 1e-13
"""Reciprocal condition number (1-norm, equilibrated) below which a matrix counts as numerically singular."""
POORLY_SCALED = 0.1
"""Least over greatest row (column) maximum below which a factorization equilibrates; LAPACK's laqge has the same."""
SMALL_COMPONENT = 32
"""Components up to this size are kept as dense blocks; a body has 3 or 6 unknowns."""
INVERTED_RCOND = 1e-8
"""Small blocks are inverted above this; the step of refinement then reaches the residual of an LU."""
PREFERENCE = 0.1
"""Share of the largest entry of its column from which the diagonal is the pivot, where the structure is symmetric."""
DENSE_LIMIT = 128
"""Up to this size a sparse matrix is factored as a dense one: SuperLU and its condition estimate cost more."""


def sparse_lu(A: Any, *, symmetric_structure: bool = False) -> Any | None:
    """Return SuperLU's factorization of a sparse matrix, None where it is exactly singular.

    With a `symmetric_structure` whose diagonal is mostly fit to be pivoted upon, A + Aᵀ is ordered and the diagonal
    preferred: half of the fill and of the time on Jacobians of contact problems.

    The structure is looked at first: SuperLU has died of structurally singular matrices (a segmentation fault on the
    KKT matrix of QBEACONF), where it should report a zero pivot.
    """
    if not has_full_structural_rank(sp.csr_array(A)):
        return None
    options: dict[str, Any] = {}
    if symmetric_structure:
        options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": PREFERENCE, "options": {"SymmetricMode": True}}
    try:
        with memory_errors():
            return spla.splu(sp.csc_array(A), **options)
    except RuntimeError:  # an exactly zero pivot
        return None


def components(A: Sparse) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """Return the label of every unknown of a square matrix and size of every component of its graph (stored zeros
    count)."""
    _, labels = cast("tuple[int, NDArray[np.int32]]", csgraph.connected_components(A, directed=False))
    return labels, np.bincount(labels)


@dataclass(frozen=True)
class Blocks:
    """Components of one size: block k is A[unknowns[k]][:, unknowns[k]]; shapes (count, size), (count, size, size)."""

    unknowns: NDArray[np.int64]
    values: NDArray[np.float64]


def diagonal_blocks(A: Sparse, limit: int) -> list[Blocks]:
    """Return the components with at most `limit` unknowns as dense blocks, one entry a size; what is larger is left
    out."""
    labels, sizes = components(A)
    order = np.argsort(labels, kind="stable")
    first = np.concatenate([[0], np.cumsum(sizes)])
    position = np.empty(labels.size, dtype=np.int64)  # of an unknown within its component
    position[order] = np.arange(labels.size) - first[labels[order]]
    row = np.repeat(np.arange(A.shape[0]), np.diff(A.indptr))
    present = np.unique(sizes[sizes <= limit])
    result: list[Blocks] = []
    for size in present:
        members = np.flatnonzero(sizes == size)
        number = np.full(sizes.size, -1)
        number[members] = np.arange(members.size)
        block, at, value = number[labels[row]], A.indices, A.data
        if sizes.size != members.size:
            here = np.flatnonzero(block >= 0)
            block, at, value = block[here], at[here], value[here]
            entry = (block * size + position[row[here]]) * size + position[at]
        else:
            entry = (block * size + position[row]) * size + position[at]
        values = np.zeros(members.size * size * size)
        values[entry] = value
        unknowns = order[first[members][:, None] + np.arange(size)]
        result.append(Blocks(unknowns, values.reshape(members.size, size, size)))
    return result


def assembled(blocks: Sequence[Blocks], shape: tuple[int, ...]) -> Sparse:
    """Return the sparse matrix that has these blocks, and no entry elsewhere."""
    data: list[NDArray[Any]] = [np.zeros(0)]
    row: list[NDArray[Any]] = [np.zeros(0, np.int64)]
    col: list[NDArray[Any]] = [np.zeros(0, np.int64)]
    for block in blocks:
        data.append(block.values.ravel())
        row.append(np.broadcast_to(block.unknowns[:, :, None], block.values.shape).ravel())
        col.append(np.broadcast_to(block.unknowns[:, None, :], block.values.shape).ravel())
    matrix = sp.csr_array((np.concatenate(data), (np.concatenate(row), np.concatenate(col))), shape=shape)
    matrix.eliminate_zeros()
    return matrix


class Factorization:
    """LU of a square matrix, made on first use and remade after pickling; part of a conversion's trace.

    Rows and columns of very different sizes (units, masses) are brought together by powers of 2 first, which costs no
    rounding: what is then called singular is so in every choice of units. A small sparse matrix is factored as a dense
    one, and a large one that is block diagonal with small blocks by their inverses.

    Attributes
    ----------
    A : the matrix, the only thing that is stored.
    """

    def __init__(self, A: Matrix) -> None:
        if A.shape[0] != A.shape[1]:
            raise ProblemError("factorization", f"needs a square matrix, has shape {A.shape}")
        self.A = A

    def __getstate__(self) -> dict[str, Any]:
        return {"A": self.A}

    @property
    def n(self) -> int:
        return int(self.A.shape[0])

    @cached_property
    def blocks(self) -> list[Blocks]:
        """The components with at most SMALL_COMPONENT unknowns, as dense blocks of A."""
        A = sparse(self.A)
        if not A.data.all():  # a stored zero connects nothing
            A = sp.csr_array(A, copy=True)
            A.eliminate_zeros()
        return diagonal_blocks(A, SMALL_COMPONENT)

    @property
    def block_diagonal(self) -> bool:
        """Whether `blocks` are all of A."""
        return sum(b.unknowns.size for b in self.blocks) == self.n

    @cached_property
    def symmetric(self) -> bool:
        """`is_symmetric` of A."""
        if self.n <= DENSE_LIMIT:
            return is_symmetric(self._small)
        if not (sp.issparse(self.A) and self.block_diagonal):
            return is_symmetric(self.A)
        return max(float(block_asymmetry(b.values).max()) for b in self.blocks) <= SYMMETRY_TOLERANCE

    @cached_property
    def block_inverses(self) -> list[Blocks]:
        """The inverses of `blocks`; raises numpy.linalg.LinAlgError when one is exactly singular."""
        return self._inverted.inverses

    @cached_property
    def sparse_inverse(self) -> Sparse:
        """A⁻¹ over `blocks`, zero elsewhere: as sparse as they are."""
        return assembled(self.block_inverses, self.A.shape)

    @cached_property
    def _inverted(self) -> _BlockInverses:
        return _BlockInverses(sparse(self.A), self.blocks, self.scales)

    @cached_property
    def scales(self) -> tuple[Vector, Vector] | None:
        """Powers of 2 for rows and columns, None where A needs none; raises LinAlgError for a zero row or column."""
        return _sparse_scales(self.A) if sp.issparse(self.A) else _dense_scales(self.A)

    @cached_property
    def _small(self) -> Dense:
        """A as a dense array."""
        return dense(self.A)

    @cached_property
    def _solver(self) -> _Solver | None:
        """Function that solves with A; None where A is exactly singular."""
        try:
            if not sp.issparse(self.A):
                return _DenseLU(self.A, self.scales)
            if self.n <= DENSE_LIMIT:
                return _DenseLU(self._small, _dense_scales(self._small))
            if self.block_diagonal and self._inverted.rcond() > INVERTED_RCOND:
                return self._inverted
            return _SparseLU(sparse(self.A), self.scales)
        except np.linalg.LinAlgError:
            return None

    @property
    def entries(self) -> int:
        """Entries of the two factors, of the inverses of small blocks, or of A where it is exactly singular."""
        return nnz(self.A) if self._solver is None else self._solver.entries

    @cached_property
    def rcond(self) -> float:
        """Reciprocal condition number in the 1-norm of the equilibrated matrix.

        LAPACK gecon, Higham–Tisseur's estimate when sparse, exact for small blocks; 1 for n = 0.
        """
        if self.n == 0:
            return 1.0
        return 0.0 if self._solver is None else self._solver.rcond()

    @property
    def singular(self) -> bool:
        return not self.rcond > SINGULAR_RCOND

    def solve(self, B: Any, *, transpose: bool = False) -> Any:
        """Return A⁻¹B (A⁻ᵀB with `transpose`) for a vector or a matrix; a sparse B comes back dense.

        Raises ProblemError where A is exactly singular.
        """
        right: NDArray[np.float64] = dense(B) if sp.issparse(B) else np.asarray(B, dtype=np.float64)
        if right.size == 0:
            return np.zeros(right.shape)
        if self._solver is None:
            raise ProblemError("factorization", f"the {self.n}x{self.n} matrix is exactly singular, nothing solves it")
        return self._solver.solve(right, transpose)


_Scales: TypeAlias = "tuple[Vector, Vector] | None"


class _Solver(Protocol):
    @property
    def entries(self) -> int: ...
    def rcond(self) -> float: ...
    def solve(self, B: NDArray[np.float64], transpose: bool) -> NDArray[np.float64]: ...


class _DenseLU:
    """LAPACK's LU of Aᵀ where A lies by rows, as all our arrays do: Fortran's order then comes without a copy."""

    def __init__(self, A: Dense, scales: _Scales) -> None:
        if scales is not None:
            A = A * scales[0][:, None] * scales[1]
        self.scales = scales
        self.flipped = not A.flags.f_contiguous
        T = A.T if self.flipped else A
        self.norm = "I" if self.flipped else "1"  # the 1-norm of A
        self.size = float(lapack.dlange(self.norm, T))
        self.entries = A.size
        self.lu, self.pivots, self.info = lapack.dgetrf(T, overwrite_a=scales is not None)

    def rcond(self) -> float:
        if self.info != 0:  # an exactly zero pivot
            return 0.0
        value, info = lapack.dgecon(self.lu, self.size, norm=self.norm)
        return float(value) if info == 0 else 0.0

    def solve(self, B: NDArray[np.float64], transpose: bool) -> NDArray[np.float64]:
        def core(right: NDArray[np.float64]) -> NDArray[np.float64]:
            return lapack.dgetrs(self.lu, self.pivots, right, trans=int(transpose != self.flipped))[0]

        return _between(core, B, self.scales, transpose)


class _SparseLU:
    """SuperLU; raises LinAlgError for an exactly singular matrix."""

    def __init__(self, A: Sparse, scales: _Scales) -> None:
        if scales is not None:
            A = sp.csr_array(A, copy=True)
            A.data *= np.repeat(scales[0], np.diff(A.indptr)) * scales[1][A.indices]
        self.scales = scales
        lu = sparse_lu(A)
        if lu is None:
            raise np.linalg.LinAlgError
        self.lu: Any = lu
        self.entries = int(lu.nnz)
        self.size = float(abs(A).sum(axis=0).max())

    def rcond(self) -> float:
        inverse = spla.LinearOperator(
            self.lu.shape,
            matvec=self.lu.solve,
            rmatvec=lambda x: self.lu.solve(np.ascontiguousarray(x), "T"),
            matmat=self.lu.solve,
            rmatmat=lambda X: self.lu.solve(np.ascontiguousarray(X), "T"),
            dtype=np.float64,
        )
        with memory_errors():
            inverse_size = float(spla.onenormest(inverse))
        return 1.0 / (self.size * inverse_size) if np.isfinite(inverse_size) and inverse_size > 0 else 0.0

    def solve(self, B: NDArray[np.float64], transpose: bool) -> NDArray[np.float64]:
        def core(right: NDArray[np.float64]) -> NDArray[np.float64]:
            with memory_errors():
                return self.lu.solve(np.ascontiguousarray(right), "T" if transpose else "N")

        return _between(core, B, self.scales, transpose)


class _BlockInverses:
    """Inverses of the diagonal blocks; a step of refinement makes up for what an inverse loses against an LU."""

    def __init__(self, A: Sparse, blocks: list[Blocks], scales: _Scales) -> None:
        self.A = A
        self.entries = sum(b.values.size for b in blocks)
        self.inverses: list[Blocks] = []
        size = inverse_size = 0.0
        for block in blocks:
            if scales is None:
                row = column = np.ones((1, 1))
            else:
                row, column = scales[0][block.unknowns], scales[1][block.unknowns]
            scaled = block.values * row[:, :, None] * column[:, None, :]
            inverse = np.linalg.inv(scaled)
            size = max(size, float(np.abs(scaled).sum(axis=1).max()))
            inverse_size = max(inverse_size, float(np.abs(inverse).sum(axis=1).max()))
            self.inverses.append(Blocks(block.unknowns, inverse * column[:, :, None] * row[:, None, :]))
        self._rcond = 1.0 / (size * inverse_size) if size * inverse_size > 0 else 0.0

    def rcond(self) -> float:
        return self._rcond

    def solve(self, B: NDArray[np.float64], transpose: bool) -> NDArray[np.float64]:
        X = self._multiply(B, transpose)
        X += self._multiply(B - (self.A.T if transpose else self.A) @ X, transpose)
        return X

    def _multiply(self, B: NDArray[np.float64], transpose: bool) -> NDArray[np.float64]:
        columns = B.reshape(B.shape[0], -1)
        X = np.empty_like(columns)
        for block in self.inverses:
            inverse = block.values.swapaxes(1, 2) if transpose else block.values
            X[block.unknowns] = inverse @ columns[block.unknowns]
        return X.reshape(B.shape)


def _between(
    core: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    B: NDArray[np.float64],
    scales: _Scales,
    transpose: bool,
) -> NDArray[np.float64]:
    """Return A⁻¹B from (RAC)⁻¹: scaled before and after, R and C changing places for A⁻ᵀ."""
    if scales is None:
        return core(B)
    before, after = scales[::-1] if transpose else scales
    column = (slice(None), *(None,) * (B.ndim - 1))
    result = core(B * before[column])
    result *= after[column]
    return result


def _dense_scales(A: Dense) -> _Scales:
    # by rows or by columns, LAPACK takes the array without a copy
    *_, first_ratio, second_ratio, _, info = lapack.dgeequb(A if A.flags.f_contiguous else A.T)
    if info != 0:  # a zero row or column
        raise np.linalg.LinAlgError
    if min(first_ratio, second_ratio) >= POORLY_SCALED:
        return None
    sizes = np.abs(A)
    scales = _even_diagonal(sizes.diagonal())
    if scales is not None and (sizes * scales[:, None] * scales).max() <= 2.0:
        return scales, scales
    row, column = np.nonzero(A)
    return _balanced(A.shape[0], row, column, np.abs(A[row, column]))


def _sparse_scales(A: Sparse) -> _Scales:
    row, size = np.repeat(np.arange(A.shape[0]), np.diff(A.indptr)), np.abs(A.data)
    rows, row_ratio = _scales_of(row, size, A.shape[0])
    _, column_ratio = _scales_of(A.indices, size * rows[row], A.shape[0])
    if min(row_ratio, column_ratio) >= POORLY_SCALED:
        return None
    return _balanced(A.shape[0], row, A.indices, size)


def _even_diagonal(diagonal: Vector) -> Vector | None:
    """Return units of unknowns in which a diagonal is about 1, None where it has a 0: near the best there is for a
    positive definite matrix (van der Sluis 1969)."""
    return np.ldexp(1.0, -np.frexp(diagonal)[1] // 2) if diagonal.all() else None


def _balanced(n: int, row: NDArray[Any], column: NDArray[Any], size: Vector) -> tuple[Vector, Vector]:
    """Return powers of 2 for the rows and columns of an n x n matrix with the entries ±size at (row, column)."""
    diagonal = np.zeros(n)
    np.maximum.at(diagonal, row[row == column], size[row == column])
    scales = _even_diagonal(diagonal)
    if scales is not None and (size * scales[row] * scales[column]).max() <= 2.0:
        return scales, scales
    candidates: list[tuple[float, tuple[Vector, Vector]]] = []
    for first, second in ((row, column), (column, row)):
        one, _ = _scales_of(first, size, n)
        other, ratio = _scales_of(second, size * one[first], n)
        candidates.append((ratio, (one, other) if first is row else (other, one)))
    return max(candidates, key=lambda item: item[0])[
        1
    ]  # what had only rows, or only columns, to scale leaves a ratio near 1


def _scales_of(line: NDArray[Any], size: Vector, n: int) -> tuple[Vector, float]:
    """Return scales of the n lines (rows or columns) the entries are in, and the ratio of least to greatest line
    maximum.

    Raises LinAlgError for a zero line.
    """
    tops = np.zeros(n)
    np.maximum.at(tops, line, size)
    if not tops.all():
        raise np.linalg.LinAlgError
    return power_of_two(tops), float(tops.min() / tops.max())


def has_full_structural_rank(A: Sparse) -> bool:
    """Return whether the rows of a square matrix can be matched with its columns; stored zeros count as entries.

    Without, no choice of its values makes it nonsingular. A greedy matching that takes rows and columns with one choice
    left first (Karp and Sipser 1981) comes within a few rows of the best one on the optimality conditions met here;
    what is left is matched along alternating paths (Duff 1981). SciPy's structural_rank, which starts from nothing,
    took minutes on the conditions of CONT-101, 20,295 rows.
    """
    if A.diagonal().all():
        return True
    rows, columns = _neighbours(A), _neighbours(sp.csr_array(A.T))
    column_of = _greedy(rows, columns)
    row_of = [-1] * len(columns)
    for row, column in enumerate(column_of):
        if column >= 0:
            row_of[column] = row
    return all(column >= 0 or _augment(row, rows, column_of, row_of) for row, column in enumerate(list(column_of)))


def _neighbours(A: Sparse) -> list[list[int]]:
    first, columns = A.indptr.tolist(), A.indices.tolist()
    return [columns[start:stop] for start, stop in itertools.pairwise(first)]


def _greedy(rows: list[list[int]], columns: list[list[int]]) -> list[int]:
    """Return a column for most rows, −1 for the others; neighbours with the fewest choices first."""
    sides = (rows, columns)
    match = [-1] * len(rows), [-1] * len(columns)
    left = [len(r) for r in rows], [len(c) for c in columns]
    forced = [(side, i) for side in (0, 1) for i, choices in enumerate(left[side]) if choices == 1]

    def take(side: int, i: int) -> None:
        free = [j for j in sides[side][i] if match[1 - side][j] < 0]
        if match[side][i] >= 0 or not free:
            return
        j = min(free, key=left[1 - side].__getitem__)
        match[side][i], match[1 - side][j] = j, i
        for one, k in ((side, i), (1 - side, j)):
            for other in sides[one][k]:
                left[1 - one][other] -= 1
                if left[1 - one][other] == 1 and match[1 - one][other] < 0:
                    forced.append((1 - one, other))

    for row in np.argsort(left[0], kind="stable").tolist():
        while forced:
            take(*forced.pop())
        take(0, row)
    return match[0]


def _augment(start: int, rows: list[list[int]], column_of: list[int], row_of: list[int]) -> bool:
    """Match the row `start` by an alternating path to a free column, breadth first; False when there is none."""
    came_from: dict[int, int] = {}
    queue = [start]
    for row in queue:
        for column in rows[row]:
            if column in came_from:
                continue
            came_from[column] = row
            if row_of[column] >= 0:
                queue.append(row_of[column])
                continue
            return _flip(column, start, came_from, column_of, row_of)
    return False


def _flip(column: int, start: int, came_from: dict[int, int], column_of: list[int], row_of: list[int]) -> bool:
    """Give every row on the path from `start` to the free `column` the column after it."""
    while True:
        row = came_from[column]
        before = column_of[row]
        column_of[row], row_of[column] = column, row
        if row == start:
            return True
        column = before
