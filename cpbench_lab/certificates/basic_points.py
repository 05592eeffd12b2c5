"""The exact point of an active set, and whether it meets all conditions."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from flint import fmpq, fmpz

from cpbench.foundation.factorization import sparse_lu
from cpbench.foundation.matrices import Sparse, Vector
from cpbench_lab.certificates.active_sets import BASIC, LOWER, UPPER, States, at_bounds
from cpbench_lab.certificates.exact_rows import ExactRows, Index, blocks, over_one, rational, regular_part, solve
from cpbench_lab.certificates.mixed import Mixed

LARGEST = 1200
"""Unknowns of the largest system that FLINT solves: half a minute."""
BLOCKS = 5000
"""Unknowns of the largest system that is taken apart into blocks: SciPy's matching may take minutes beyond."""
MANY = 200
"""Unknowns from which factors in doubles are tried first."""


@dataclass(frozen=True, eq=False)
class Support:
    """The numbers that determine an exact solution.

    Attributes
    ----------
    held : (N,) the doubles that unknowns are held at, NaN where they are solved for. rows, columns : the equations
    (Kx + c)ᵢ = 0 that are solved, and for which unknowns. ends : where each block of both ends, in order.
    """

    held: Vector
    rows: Index
    columns: Index
    ends: Index


@dataclass(frozen=True, eq=False)
class ExactPoint:
    """A support with its exact solution, or what stops the proof."""

    support: Support | None
    x: Sequence[Any]
    reason: str = ""


def exact_point(P: Mixed, K: ExactRows, states: States, near: Vector, deadline: float = math.inf) -> ExactPoint:
    """Return the exact point with these states; what is redundant among the basic unknowns is held near `near`."""
    held = at_bounds(P, states)
    basic = np.flatnonzero(states == BASIC).astype(np.int64)
    x = _rationals(held)
    if basic.size > MANY:
        result = _of_independent(P, K, held, basic, near, deadline)
        if result is not None or basic.size > BLOCKS:
            return result or ExactPoint(None, [], too_large(basic.size))
    rows: list[Index] = []
    columns: list[Index] = []
    for own_rows, own_columns in blocks(P.K, basic):
        part = solved_exactly(P, K, own_rows, own_columns, x, deadline)
        if part is None:
            if own_rows.size > LARGEST:
                return ExactPoint(None, [], too_large(own_rows.size))
            all_columns = own_columns
            own_rows, own_columns = regular_part(K, own_rows, own_columns, near[own_columns])
            for j in np.setdiff1d(all_columns, own_columns).tolist():
                held[j] = min(max(float(near[j]), P.lo[j]), P.hi[j])
                x[j] = rational(held[j])
            part = solved_exactly(P, K, own_rows, own_columns, x, deadline)
            if part is None:
                return ExactPoint(None, [], "the system of the active set is singular")
        for j, value in zip(own_columns.tolist(), part, strict=True):
            x[j] = value
        rows.append(own_rows)
        columns.append(own_columns)
    none = np.zeros(0, dtype=np.int64)
    ends = np.cumsum([part.size for part in rows], dtype=np.int64)
    return ExactPoint(Support(held, np.concatenate([none, *rows]), np.concatenate([none, *columns]), ends), x)


def _of_independent(
    P: Mixed, K: ExactRows, held: Vector, basic: Index, near: Vector, deadline: float
) -> ExactPoint | None:
    """Return the exact point of a large system at once; unknowns that the others leave open are held near `near`. None
    where doubles do not tell its digits."""
    some = basic[independent(sp.csr_array(P.K[basic][:, basic]), near[basic])]
    rest, held = np.setdiff1d(basic, some), held.copy()
    held[rest] = np.clip(near[rest], P.lo[rest], P.hi[rest])
    x = _rationals(held)
    part = refined(sp.csr_array(P.K[some][:, some]), sides(P, K, some, x), deadline)
    return None if part is None else _with(held, x, some, some, part)


def solved_exactly(
    P: Mixed, K: ExactRows, rows: Index, columns: Index, x: Sequence[Any], deadline: float
) -> list[Any] | None:
    """Return the unknowns at which these rows are 0 with the others as they are in x, where these are 0; None where the
    system is singular, or is large and near to that."""
    right = sides(P, K, rows, x)
    part = refined(sp.csr_array(P.K[rows][:, columns]), right, deadline) if rows.size > MANY else None
    if part is None and rows.size <= LARGEST and time.perf_counter() < deadline:
        return solve(K, rows, columns, right)
    return part


def system_point(P: Mixed, K: ExactRows, held: Vector, rows: Index, columns: Index, deadline: float) -> ExactPoint:
    """Return the exact point at which these rows are 0 and the other unknowns are held."""
    x = _rationals(held)
    part = solved_exactly(P, K, rows, columns, x, deadline)
    if part is None:
        return ExactPoint(None, [], too_large(rows.size) if rows.size > LARGEST else "")
    return _with(held, x, rows, columns, part)


def _rationals(held: Vector) -> list[Any]:
    """Return what unknowns are held at, 0 for those that are solved for."""
    return [rational(0.0 if value != value else value) for value in held.tolist()]


def _with(held: Vector, x: list[Any], rows: Index, columns: Index, part: Sequence[Any]) -> ExactPoint:
    """Return the point with the unknowns that one system gives."""
    for j, value in zip(columns.tolist(), part, strict=True):
        x[j] = value
    return ExactPoint(Support(held, rows, columns, np.array([rows.size])), x)


def too_large(size: int) -> str:
    """Say that a system is too large for FLINT, and no factors in doubles are good enough for it."""
    return f"{size} unknowns hang together: more than {LARGEST} are solved only where doubles tell their digits"


def sides(P: Mixed, K: ExactRows, rows: Index, x: Sequence[Any]) -> list[Any]:
    """Return −c − Kx of some rows; unknowns that are still to come are 0."""
    chosen = rows.tolist()
    return [-rational(float(P.c[i])) - v for i, v in zip(chosen, K.products(x, chosen), strict=True)]


def violations(P: Mixed, K: ExactRows, x: Sequence[Any]) -> list[tuple[int, int]]:
    """Places at which the exact point x breaks the conditions, each with the state it should rather have."""
    numerators, common = over_one(x)
    wrong: list[tuple[int, int]] = []
    for i, (low, high, c) in enumerate(zip(P.lo.tolist(), P.hi.tolist(), P.c.tolist(), strict=True)):
        side = _beside(x[i], low, high)
        if abs(side) == 2:
            wrong.append((i, LOWER if side < 0 else UPPER))
        elif low < high:
            total, exponent = K.times(i, numerators)
            f = _sign(total, exponent, c, common)
            if (side == LOWER and f < 0) or (side == UPPER and f > 0) or (side == BASIC and f != 0):
                wrong.append((i, BASIC))
    return wrong


def _beside(x: Any, low: float, high: float) -> int:
    """Return −2 below the bounds, −1 at the lower, 0 between them, 1 at the upper, 2 above."""
    if low > -np.inf:
        bound = rational(low)
        if x <= bound:
            return LOWER if x == bound else 2 * LOWER
    if high < np.inf:
        bound = rational(high)
        if x >= bound:
            return UPPER if x == bound else 2 * UPPER
    return BASIC


def _sign(total: Any, exponent: int, c: float, common: Any) -> int:
    """Return the sign of total·2^exponent/common + c."""
    numerator, denominator = c.as_integer_ratio()
    left, right = total * denominator, common * numerator
    if exponent >= 0:
        left *= fmpz(1) << exponent
    else:
        right *= fmpz(1) << -exponent
    whole = left + right
    return (whole > 0) - (whole < 0)


def row_value(P: Mixed, K: ExactRows, i: int, x: Sequence[Any]) -> Any:
    """Return (Kx + c)ᵢ."""
    return -sides(P, K, np.array([i]), x)[0]


# ----------------------------------------------------------------------------------------------------------- refinement
# Exact solutions of large sparse systems: digits from a factorization in doubles, residuals in integers.
#
# A step solves for the residual with the factors, rounds the result to a grid of powers of two, and takes it off the
# residual exactly, which shrinks by what the factors are good for. A rational is known by its first digits, twice as
# many as its denominator has (Z. Wan, J. Symb. Comput. 41, 2006; W. Cook and D. Steffy, ACM Trans. Math. Softw. 37,
# 2011): digits are doubled until a common denominator is found.

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
