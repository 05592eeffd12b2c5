"""P-matrices, the class that decides whether an LCP has one solution, and Z-matrices.

Z: no positive entry off the diagonal; such a matrix is P exactly when it is a nonsingular M-matrix. P: all principal
minors positive; equivalently LCP(M, q) has one solution for every q (Cottle, Pang, Stone, The Linear Complementarity
Problem (1992), 3.3 and 3.11). The recursion over Schur complements is that of Tsatsomeros and Li, BIT 40 (2000).
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.csgraph as csgraph
from numpy.typing import NDArray

from cpbench.foundation import matrices
from cpbench.foundation.matrices import Dense, Matrix, Vector
from cpbench_lab.facts.fact import Fact, How, undecided

MINORS_LIMIT = 18
"""Largest irreducible block whose 2ⁿ − 1 principal minors are all looked at (about a second)."""
MINORS_WORK = 2.0**20
"""Bound on the sum of 2ⁿ over the blocks."""
EPS = float(np.finfo(float).eps)


def z_matrix(M: Matrix, name: str) -> Fact:
    """Decide whether no entry off the diagonal is positive."""
    off = _off_diagonal(M)
    largest = float(off.data.max(initial=0.0))
    if largest > 0:
        return Fact("Z-matrix", name, False, How.EXACT, largest, evidence="largest entry off the diagonal")
    return Fact("Z-matrix", name, True, How.EXACT, evidence="no positive entry off the diagonal")


def p_matrix(M: Matrix, name: str, definiteness: Fact) -> Fact:
    """Decide whether all principal minors are positive; `definiteness` is that of the same matrix.

    Decided by all minors of the irreducible diagonal blocks where they are small enough; else by definiteness, or by a
    minor of order 1 or 2.
    """
    label, n = "P-matrix", M.shape[0]
    if n == 0:
        return Fact(label, name, True, How.EXACT, evidence="no rows")
    diagonal = np.asarray(M.diagonal())
    i = int(diagonal.argmin())
    if diagonal[i] <= 0:
        return _counterexample(M, name, [i])
    pair = _bad_pair(M, diagonal)
    if pair is not None:
        return _counterexample(M, name, pair)
    blocks = _irreducible_blocks(M)
    if max(b.size for b in blocks) <= MINORS_LIMIT and sum(2.0**b.size for b in blocks) <= MINORS_WORK:
        return _by_minors(M, name, blocks)
    if definiteness.value == "positive definite":
        return Fact(label, name, True, definiteness.how, evidence="positive definite")
    largest = max(b.size for b in blocks)
    return undecided(
        label,
        name,
        f"irreducible block of {largest} rows, all minors are looked at up to {MINORS_LIMIT}; not positive definite, "
        "no minor of order 1 or 2 fails",
    )


def exact_minor(M: Matrix, rows: list[int]) -> Fraction:
    """Compute the principal minor of these rows in rational arithmetic, of the numbers as stored."""
    part = sp.csr_array(M)[rows][:, rows].toarray() if matrices.is_sparse(M) else matrices.dense(M)[np.ix_(rows, rows)]
    A = [[Fraction(float(x)) for x in line] for line in part]
    result = Fraction(1)
    for k in range(len(A)):
        pivot = next((i for i in range(k, len(A)) if A[i][k]), None)
        if pivot is None:
            return Fraction(0)
        if pivot != k:
            A[k], A[pivot] = A[pivot], A[k]
            result = -result
        result *= A[k][k]
        for i in range(k + 1, len(A)):
            ratio = A[i][k] / A[k][k]
            if ratio:
                A[i] = [x - ratio * y for x, y in zip(A[i], A[k], strict=True)]
    return result


def _off_diagonal(M: Matrix) -> Any:
    """Return the entries off the diagonal, CSR."""
    csr = sp.csr_array(M, copy=True)
    csr = csr - sp.diags_array(np.asarray(csr.diagonal()), format="csr")
    csr.eliminate_zeros()
    return sp.csr_array(csr)


def _bad_pair(M: Matrix, diagonal: Vector) -> list[int] | None:
    """Find rows of a principal minor of order 2 that is not positive; only pairs with both entries stored can fail."""
    off = _off_diagonal(M)
    product = sp.coo_array(off * sp.csr_array(off.T))
    row, col = product.row, product.col
    bound = diagonal[row] * diagonal[col]
    ratio = np.divide(product.data, bound, out=np.full(bound.size, np.inf), where=bound > 0)
    suspects = np.flatnonzero(ratio >= 1.0 - 8 * EPS)
    for k in suspects[np.argsort(-ratio[suspects])][:20]:
        pair = sorted((int(row[k]), int(col[k])))
        if exact_minor(M, pair) <= 0:
            return pair
    return None


def _irreducible_blocks(M: Matrix) -> list[NDArray[Any]]:
    """Return the rows of the diagonal blocks of a block triangular form (strong components); a minor is a product of
    theirs.
    """
    csr = sp.csr_array(M, copy=True)
    csr.eliminate_zeros()
    count, labels = csgraph.connected_components(csr, directed=True, connection="strong")
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.cumsum(np.bincount(labels, minlength=count))[:-1])


def _by_minors(M: Matrix, name: str, blocks: list[NDArray[Any]]) -> Fact:
    least = np.inf
    for rows in blocks:
        part = M[rows][:, rows] if matrices.is_sparse(M) else M[np.ix_(rows, rows)]
        ratio, bad = least_ratio(matrices.dense(part))
        if bad is not None:
            minor = [int(rows[k]) for k in bad]
            exact = exact_minor(part, bad)
            if exact <= 0:
                return _failed(name, minor, exact)
            where = _rows(minor)
            return undecided("P-matrix", name, f"the minor of {where} is positive, too near 0 to go on", float(exact))
        least = min(least, ratio)
    evidence = "all principal minors; least ratio of nested ones, diagonal scaled to 1:"
    return Fact("P-matrix", name, True, How.EXACT, least, evidence=evidence)


def least_ratio(A: Dense) -> tuple[float, list[int] | None]:
    """Find the least ratio det A[α ∪ k]/det A[α], k > α, over all α, and the rows α ∪ k of the first that rounding does
    not tell from nonpositive. The diagonal of A must be positive; it is scaled to 1.

    Level k holds A/A[α] for all 2ᵏ subsets α of the first k rows, restricted to the rows from k on: its first
    entry is the ratio for k; dropping row k or eliminating it makes level k + 1.
    """
    n = A.shape[0]
    root = 1.0 / np.sqrt(A.diagonal())
    stack = (A * root[:, None] * root)[None]
    subset = np.zeros(1, dtype=np.int64)
    growth = np.abs(stack).max(axis=(1, 2), initial=1.0)
    least = np.inf
    for k in range(n):
        pivot = stack[:, 0, 0]
        failing = np.flatnonzero(pivot <= 8 * n * EPS * growth)
        if failing.size:
            first = min(failing, key=lambda f: int(subset[f]).bit_count())
            return float(pivot[first]), [i for i in range(k) if int(subset[first]) >> i & 1] + [k]
        least = min(least, float(pivot.min()))
        dropped = stack[:, 1:, 1:]
        eliminated = dropped - stack[:, 1:, :1] * stack[:, :1, 1:] / pivot[:, None, None]
        grown = np.maximum(growth, np.abs(eliminated).max(axis=(1, 2), initial=0.0))
        stack = np.concatenate([dropped, eliminated])
        subset = np.concatenate([subset, subset | (1 << k)])
        growth = np.concatenate([growth, grown])
    return least, None


def _counterexample(M: Matrix, name: str, rows: list[int]) -> Fact:
    value = Fraction(float(M[rows[0], rows[0]])) if len(rows) == 1 else exact_minor(M, rows)
    return _failed(name, rows, value)


def _failed(name: str, rows: list[int], minor: Fraction) -> Fact:
    try:
        value = float(minor)
    except OverflowError:  # it is beyond the largest float
        value = float("inf") if minor > 0 else float("-inf")
    return Fact("P-matrix", name, False, How.EXACT, value, evidence=f"principal minor of {_rows(rows)} is")


def _rows(rows: list[int]) -> str:
    """Return rows counted from 1, as in the mathematics."""
    return f"row {rows[0] + 1}" if len(rows) == 1 else "rows " + ", ".join(str(i + 1) for i in rows)
