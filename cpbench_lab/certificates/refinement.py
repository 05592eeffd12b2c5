"""Exact solutions of large sparse systems: digits from a factorization in doubles, residuals in integers.

A step solves for the residual with the factors, rounds the result to a grid of powers of two, and takes it off the
residual exactly, which shrinks by what the factors are good for. A rational is known by its first digits, twice as many
as its denominator has (Z. Wan, J. Symb. Comput. 41, 2006; W. Cook and D. Steffy, ACM Trans. Math. Softw. 37, 2011):
digits are doubled until a common denominator is found.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from flint import fmpq, fmpz

from cpbench.foundation.factorization import sparse_lu
from cpbench.foundation.matrices import Sparse, Vector
from cpbench_lab.certificates.exact_rows import ExactRows, Index, over_one

STEP, LEAST = 44, 4
"""Binary digits that a step takes from doubles, and those that it must gain, or the factors are not good for it."""
DOUBT = 16
"""Binary digits by which an approximation is worse than its last one, and a denominator shorter than it may be."""
FIRST = 256
"""Binary digits at which a common denominator is looked for at first."""
CHANGE = 1e-10
"""Share of the largest entries of rows and columns by which the diagonal is changed, to tell dependent unknowns."""
ORDERED = 5000
"""Unknowns of the largest system that is factored in a given order: its factors fill in."""
DENSE = 200_000
"""Entries of the largest matrix: of a dense one FLINT has the digits sooner."""


def refined(A: Sparse, right: Sequence[Any], deadline: float) -> list[Any] | None:
    """Return x with A x = right over the rationals; None where doubles do not tell its digits, or the time is over.

    Whoever asks checks the rows: what is read off the digits is right but for an accident. A : (n, n), finite.
    right : n rationals. deadline : of `time.perf_counter` [s].
    """
    if A.nnz > DENSE or not A.nnz or (np.diff(A.indptr) == 0).any():
        return None
    scaled, rows, columns = _scaled(A)
    factors = sparse_lu(scaled) if np.isfinite(scaled.data).all() else None
    if factors is None:
        return None
    exact, (numerators, common) = ExactRows.of(A), over_one(right)
    raised, lowered = np.maximum(exact.exponents, 0).tolist(), np.maximum(-np.array(exact.exponents), 0).tolist()
    entries: Any = np.array([v << k for row, k in zip(exact.values, raised, strict=True) for v in row], dtype=object)
    residual: Any = np.array([int(b) << k for b, k in zip(numerators, lowered, strict=True)], dtype=object)
    units = rows * np.ldexp(1.0, np.minimum(exact.exponents, 0))
    digits, places, wanted, known = list[tuple[Any, int]](), 0, FIRST, -(10**9)
    while True:
        try:
            z = columns * factors.solve(units * residual.astype(np.float64))
        except OverflowError:  # numbers beyond all doubles
            return None
        top = int(np.frexp(np.abs(z).max())[1]) if z.any() else -STEP
        if time.perf_counter() > deadline or not np.isfinite(z).all() or places - top < known + LEAST:
            return None
        known = places - top
        if known >= wanted or not z.any():
            x: Any = residual * 0
            for part, width in digits:
                x = x * (1 << width) + part
            digits = [(x, places)]
            whole = over_common_denominator([fmpz(v) for v in x], places, max(top, 0) + DOUBT)
            if whole is not None:
                return [fmpq(v, common * whole[1]) for v in whole[0]]
            wanted = 2 * known
        more, less = max(STEP - top, 0), max(top - STEP, 0)
        step = np.rint(np.ldexp(z, more - less)).astype(np.int64).astype(object) * (1 << less)
        residual = residual * (1 << more) - np.add.reduceat(entries * step[A.indices], A.indptr[:-1])
        places += more
        _put(digits, step, more)


def _put(digits: list[tuple[Any, int]], later: Any, places: int) -> None:
    """Put digits behind others: those that are no longer than what comes become one with it, so that long numbers are
    seldom touched."""
    while digits and digits[-1][1] <= places:
        before, more = digits.pop()
        later, places = before * (1 << places) + later, places + more
    digits.append((later, places))


def independent(A: Sparse, near: Vector) -> Index:
    """Return which unknowns of a square system determine the others, as far as doubles tell, the largest at `near`
    first where the system is small: the others' pivots are no more than a small change of the diagonal makes them. Of a
    matrix with M + Mᵀ semidefinite, as those of convex programs are, the rows of the same numbers are independent."""
    n = A.shape[0]
    scaled, _, _ = _scaled(A)
    if not n or A.nnz > DENSE or not np.isfinite(scaled.data).all():
        return np.arange(n)
    rng = np.random.default_rng(0)
    change = CHANGE * rng.uniform(1.0, 2.0, n) * rng.choice([-1.0, 1.0], n)
    order = np.argsort(-np.abs(near), kind="stable") if n <= ORDERED else np.arange(n)
    changed: Any = sp.csc_matrix((scaled + sp.diags_array(change))[order][:, order])
    try:
        factors = spla.splu(changed, permc_spec="NATURAL" if n <= ORDERED else "COLAMD")
    except RuntimeError:  # exactly singular
        return np.arange(n)
    return np.sort(order[np.abs(factors.U.diagonal())[factors.perm_c] > CHANGE**0.5])


def _scaled(A: Sparse) -> tuple[Any, Any, Any]:
    """Return A with rows and columns of like sizes, and the powers of two by which they were multiplied."""
    rows = np.ldexp(1.0, -np.frexp(abs(A).max(axis=1).toarray().ravel())[1])
    scaled: Any = sp.diags_array(rows) @ A
    columns = np.ldexp(1.0, -np.frexp(abs(scaled).max(axis=0).toarray().ravel())[1])
    return sp.csc_array(scaled @ sp.diags_array(columns)), rows, columns


def over_common_denominator(x: list[Any], places: int, doubt: int) -> tuple[list[Any], Any] | None:
    """Return integers v and the least D with v/D = x/2^places but for its last `doubt` binary digits; None where D has
    more digits than x tells."""
    whole, D = fmpz(1) << places, fmpz(1)
    most = (places - doubt) // 2 - DOUBT
    for value in x:
        rest = value * D % whole
        if min(rest, whole - rest) <= D << doubt:
            continue
        # the convergents of rest/whole: the least q for which q·rest is a multiple of it
        larger, before, q = whole, fmpz(0), fmpz(1)
        while rest > (D * q) << doubt:
            if D.bit_length() + q.bit_length() > most:
                return None
            quotient = larger // rest
            larger, rest, before, q = rest, larger - quotient * rest, q, quotient * q + before
        D *= q
    half = whole // 2
    return [(value * D + half) >> places for value in x], D
