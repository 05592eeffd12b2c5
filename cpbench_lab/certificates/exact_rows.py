"""Matrices of doubles as integers by rows, exact products with them, and exact solutions of square systems.

A system is taken apart into irreducible blocks first (matching, then strongly connected components), so that a sparse
one needs little more than its blocks. A block is solved by FLINT, by lifting from one prime (Dixon, Numer. Math. 40,
1982).
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import scipy.sparse as sp
from flint import fmpq, fmpq_mat, fmpz, fmpz_mat, nmod_mat
from numpy.typing import NDArray
from scipy.linalg import qr
from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

from cpbench.foundation.matrices import Sparse, Vector

PRIME = 2**61 - 1
"""A Mersenne prime: a matrix of integers loses rank modulo it only by a rare accident, which a proof then lacks."""
LARGEST = 1500
"""Rows, or columns, of the largest system that `solve_near` solves."""
Index = NDArray[np.int64]


def rational(value: float) -> Any:
    """Return the finite double as it is."""
    return fmpq(*value.as_integer_ratio())


def nearest(value: Any) -> float:
    """Return the double nearest to a rational; ±∞ beyond all doubles."""
    try:
        return int(value.p) / int(value.q)
    except OverflowError:
        return math.copysign(math.inf, 1 if value.p > 0 else -1)


@dataclass(frozen=True, eq=False)
class ExactRows:
    """A sparse matrix of doubles: row i is Σ values[i][k] · 2^exponents[i] in the columns columns[i][k]."""

    columns: list[list[int]]
    values: list[list[int]]
    exponents: list[int]

    @classmethod
    def of(cls, matrix: Sparse) -> ExactRows:
        """Return every stored number; raises nothing, for a problem's data are finite."""
        mantissas, exponents = np.frexp(matrix.data)
        whole = (mantissas * 2.0**53).astype(np.int64)
        exponents = exponents.astype(np.int64) - 53
        starts = matrix.indptr.tolist()
        least: list[int] = []
        values: list[list[int]] = []
        for a, b in pairwise(starts):
            own = exponents[a:b]
            low = int(own.min()) if b > a else 0
            least.append(low)
            pairs = zip(whole[a:b].tolist(), (own - low).tolist(), strict=True)
            values.append([value << shift for value, shift in pairs])
        columns = [matrix.indices[a:b].tolist() for a, b in pairwise(starts)]
        return cls(columns, values, least)

    def times(self, row: int, numerators: Sequence[Any]) -> Any:
        """Row · numerators, exact, as (integer, exponent of 2)."""
        pairs = zip(self.values[row], self.columns[row], strict=True)
        return sum((numerators[j] * value for value, j in pairs), fmpz(0)), self.exponents[row]

    def products(self, x: Sequence[Any], rows: Iterable[int] | None = None, *, absolute: bool = False) -> list[Any]:
        """Return rows times x over the rationals, all rows by default; of the absolute values where asked."""
        found: list[Any] = []
        for i in range(len(self.values)) if rows is None else rows:
            pairs = zip(self.values[i], self.columns[i], strict=True)
            total = sum((x[j] * (abs(v) if absolute else v) for v, j in pairs), fmpq(0))
            found.append(total * fmpq(2) ** self.exponents[i])
        return found


def over_one(values: Sequence[Any]) -> tuple[list[Any], Any]:
    """Numerators over their least common denominator, and that."""
    common = fmpz(1)
    for value in values:
        if common % value.q != 0:
            common = common * value.q // common.gcd(value.q)
    return [value.p * (common // value.q) for value in values], common


def blocks(K: Sparse, chosen: Index) -> list[tuple[Index, Index]]:
    """Rows and columns of the irreducible blocks of K[chosen, chosen], in the order in which they can be solved.

    One block of everything where the pattern alone says that the matrix is singular.
    """
    part: Any = sp.csr_array(K[chosen][:, chosen])
    if chosen.size == 0:
        return []
    partner = np.asarray(maximum_bipartite_matching(sp.csr_matrix(part), perm_type="column"), dtype=np.int64)
    if (partner < 0).any():
        return [(chosen, chosen)]
    entries: Any = part.tocoo()
    owner = np.empty(chosen.size, dtype=np.int64)
    owner[partner] = np.arange(chosen.size)
    # row i determines column partner[i]; it needs the rows that determine its other columns
    needs = sp.csr_array((np.ones(entries.nnz), (entries.row, owner[entries.col])), shape=part.shape)
    count, label = connected_components(sp.csr_matrix(needs), connection="strong")
    order = _topological(needs, label, int(count))
    members: list[list[int]] = [[] for _ in range(int(count))]
    for row, at in enumerate(label.tolist()):
        members[at].append(row)
    return [(chosen[members[at]], chosen[partner[members[at]]]) for at in order]


def _topological(needs: Any, label: Any, count: int) -> list[int]:
    edges: Any = needs.tocoo()
    pairs = np.unique(np.column_stack([label[edges.col], label[edges.row]]), axis=0)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    waiting = np.bincount(pairs[:, 1], minlength=count)
    after: list[list[int]] = [[] for _ in range(count)]
    for first, then in pairs.tolist():
        after[first].append(then)
    ready, order = deque(np.flatnonzero(waiting == 0).tolist()), list[int]()
    while ready:
        at = ready.popleft()
        order.append(at)
        for then in after[at]:
            waiting[then] -= 1
            if waiting[then] == 0:
                ready.append(then)
    return order


def solve(K: ExactRows, rows: Index, columns: Index, right: Sequence[Any]) -> list[Any] | None:
    """Return the exact solution of K[rows, columns] x = right; None where the block is singular."""
    integers, row_units, column_units = _integers(K, rows, columns)
    sides = fmpq_mat(len(right), 1, [b * _power(-e) for b, e in zip(right, row_units, strict=True)])
    try:
        if len(right) == 1:
            found = [sides[0, 0] / integers[0, 0]]
        else:
            found = fmpq_mat(integers).solve(sides, algorithm="dixon").entries()
    except ZeroDivisionError:
        return None
    return [x * _power(-e) for x, e in zip(found, column_units, strict=True)]


def solve_near(K: Sparse, right: Sequence[Any], near: Vector) -> list[Any] | None:
    """Return an exact solution of K x = right of which as many components as possible are those of `near`, rounded to
    24 binary digits; None where there is none, or K is too large."""
    if max(K.shape) > LARGEST:
        return None
    fraction, exponent = np.frexp(near)
    x = [rational(value) for value in np.ldexp(np.round(np.ldexp(fraction, 24)), exponent - 24).tolist()]
    exact = ExactRows.of(K)
    if exact.products(x) == list(right):
        return x
    rows, columns = regular_part(exact, np.arange(K.shape[0]), np.arange(K.shape[1]), near)
    for j in columns.tolist():
        x[j] = fmpq(0)
    needed = [right[i] - value for i, value in zip(rows.tolist(), exact.products(x, rows.tolist()), strict=True)]
    part = solve(exact, rows, columns, needed)
    for j, value in zip(columns.tolist(), part or (), strict=part is not None):
        x[j] = value
    return x if exact.products(x) == list(right) else None


def regular_part(K: ExactRows, rows: Index, columns: Index, near: Vector) -> tuple[Index, Index]:
    """Rows and columns of a largest regular block, well conditioned where `near` says how large the unknowns are."""
    integers, row_units, column_units = _integers(K, rows, columns)
    sizes = np.array([[nearest(fmpq(v)) for v in row] for row in integers.tolist()])
    sizes = np.ldexp(sizes, np.array(row_units)[:, None] + np.array(column_units)[None, :])
    sizes = sizes * np.where(near != 0.0, np.abs(near), np.abs(near).max(initial=0.0) or 1.0)[None, :]
    top = np.abs(sizes).max(axis=1, initial=0.0)
    sizes = sizes / np.where(top > 0.0, top, 1.0)[:, None]
    some = _independent(integers, _order(sizes))
    other = _independent(_taken(integers, some).transpose(), _order(sizes[:, some].T))
    return rows[other], columns[some]


def _order(sizes: NDArray[np.float64]) -> list[int]:
    pivots: Any = qr(sizes, mode="r", pivoting=True, check_finite=False)[1]
    return pivots.tolist()


def _taken(integers: Any, columns: list[int]) -> Any:
    whole = integers.tolist()
    return fmpz_mat(len(whole), len(columns), [row[j] for row in whole for j in columns])


def _independent(integers: Any, order: list[int]) -> list[int]:
    """Columns that are independent, the first ones of an order."""
    reduced: Any
    reduced, rank = nmod_mat(_taken(integers, order), PRIME).rref()
    places: list[int] = []
    column = 0
    for row in range(int(rank)):
        while reduced[row, column] == 0:
            column += 1
        places.append(order[column])
        column += 1
    return places


def _power(exponent: int) -> Any:
    return fmpq(fmpz(1) << exponent) if exponent >= 0 else fmpq(1, fmpz(1) << -exponent)


def _integers(K: ExactRows, rows: Index, columns: Index) -> tuple[Any, list[int], list[int]]:
    """Integers A, r and c with K_ij = A_ij 2^(r_i + c_j)."""
    place = {j: k for k, j in enumerate(columns.tolist())}
    table: list[list[int]] = []
    for i in rows.tolist():
        row = [0] * len(place)
        for j, value in zip(K.columns[i], K.values[i], strict=True):
            if j in place:
                row[place[j]] = value
        table.append(row)
    shifts = [min(((v & -v).bit_length() - 1 for v in column if v), default=0) for column in zip(*table, strict=True)]
    entries = [value >> shift for row in table for value, shift in zip(row, shifts, strict=True)]
    return fmpz_mat(len(table), len(place), entries), [K.exponents[i] for i in rows.tolist()], shifts
