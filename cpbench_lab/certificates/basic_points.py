"""The exact point of an active set, and whether it meets all conditions."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from flint import fmpz

from cpbench.foundation.matrices import Vector
from cpbench_lab.certificates.active_sets import BASIC, LOWER, UPPER, States, at_bounds
from cpbench_lab.certificates.exact_rows import ExactRows, Index, blocks, over_one, rational, regular_part, solve
from cpbench_lab.certificates.mixed import Mixed
from cpbench_lab.certificates.refinement import independent, refined

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
