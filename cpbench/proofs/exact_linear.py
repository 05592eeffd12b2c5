"""Linear algebra over the rationals: exact products with matrices of doubles, exact solutions of linear systems.

A double is a rational m·2^e. A system is solved by Dixon's lifting (Numer. Math. 40, 1982): the inverse modulo a prime
gives one p-adic digit of the solution after the other, and a rational reconstruction the fractions. That needs NumPy
alone and can be stopped at any digit, which is why no library of exact arithmetic is a dependency of the package.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np
import scipy.linalg as sl
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.foundation.matrices import Matrix, Vector

Rationals: TypeAlias = list[Fraction]
_Integers: TypeAlias = NDArray[np.int64]

PRIME = 33554393
"""The largest prime below 2^25: sums of 2^13 products of two residues fit into 63 bits."""
_LIMB = 24
LARGEST = 1500
"""Unknowns, or equations, of the largest system that is solved."""
_ZERO = Fraction(0)


@dataclass(frozen=True)
class Exact:
    """A matrix of doubles as integers times one power of two, by entries.

    Attributes
    ----------
    shape : rows, columns. row, column : places of the entries. value : the integers. exponent : of the power of two.
    """

    shape: tuple[int, int]
    row: list[int]
    column: list[int]
    value: list[int]
    exponent: int

    @classmethod
    def of(cls, matrix: Matrix) -> Exact:
        """Return every entry that is not 0; raises nothing, for a problem's data are finite."""
        entries: Any = sp.coo_array(matrix)
        kept = np.flatnonzero(entries.data)
        ratios = [entry.as_integer_ratio() for entry in np.asarray(entries.data, dtype=np.float64)[kept].tolist()]
        common = max((below for _, below in ratios), default=1)
        value, exponent = [above * (common // below) for above, below in ratios], 1 - common.bit_length()
        rows, columns = matrix.shape
        return cls((rows, columns), entries.row[kept].tolist(), entries.col[kept].tolist(), value, exponent)

    def absolute(self) -> Exact:
        """Return the matrix of the entries' sizes."""
        return replace(self, value=[abs(v) for v in self.value])

    def times(self, x: Sequence[Fraction]) -> Rationals:
        """Return the product with x, exact."""
        return self._product(self.row, self.column, self.shape[0], x)

    def transposed_times(self, x: Sequence[Fraction]) -> Rationals:
        """Return the product of the transposed with x, exact."""
        return self._product(self.column, self.row, self.shape[1], x)

    def _product(self, to: list[int], by: list[int], size: int, x: Sequence[Fraction]) -> Rationals:
        common = math.lcm(*(value.denominator for value in x))
        numerators = [value.numerator * (common // value.denominator) for value in x]
        sums = [0] * size
        for place, source, value in zip(to, by, self.value, strict=True):
            if numerators[source]:
                sums[place] += value * numerators[source]
        unit = Fraction(2) ** self.exponent / common
        return [total * unit if total else _ZERO for total in sums]


def rationals(x: Vector) -> Rationals:
    """Return the doubles of a finite vector as they are."""
    return [Fraction(value) for value in x.tolist()]


def rounded(x: Vector, bits: int = 24) -> Rationals:
    """Return the components of a finite vector, each to so many binary digits."""
    fraction, exponent = np.frexp(x)
    return rationals(np.ldexp(np.round(np.ldexp(fraction, bits)), exponent - bits))


def dot(x: Sequence[Fraction], y: Sequence[Fraction]) -> Fraction:
    """Return Σ xᵢ yᵢ."""
    return sum((a * b for a, b in zip(x, y, strict=True) if a and b), _ZERO)


def solve(matrix: Matrix, right: Sequence[Fraction], near: Vector, deadline: float = math.inf) -> Rationals | None:
    """Return an exact solution of `matrix` x = `right` whose free components are those of `near`, rounded.

    Unknowns with the largest terms are solved for, the others keep their value. None where there is no solution, the
    system is too large, or `time.perf_counter()` reaches `deadline`.
    """
    rows, columns = matrix.shape
    exact, start = Exact.of(matrix), rounded(near)
    rest = [b - a for a, b in zip(exact.times(start), right, strict=True)]
    if not any(rest):
        return start
    if max(rows, columns) > LARGEST or not exact.value:
        return None
    integers = np.zeros(exact.shape, dtype=object)
    integers[exact.row, exact.column] = exact.value
    pivots = _pivots(integers, _order(matrix, near), deadline)
    if pivots is None:
        return None
    chosen_rows, chosen_columns, inverse = pivots
    held = list(start)
    for column in chosen_columns:
        held[column] = _ZERO
    unit = Fraction(2) ** -exact.exponent
    need = [(b - a) * unit for a, b in zip(exact.times(held), right, strict=True)]
    block = integers[np.ix_(chosen_rows, chosen_columns)]
    for found in _lifted(block, inverse, [need[row] for row in chosen_rows], deadline):
        for column, value in zip(chosen_columns, found, strict=True):
            held[column] = value
        reached = exact.times(held)
        if all(reached[row] == right[row] for row in chosen_rows):
            return held if reached == list(right) else None
    return None


def _order(matrix: Matrix, near: Vector) -> list[int]:
    """Columns by what their terms add that those before did not."""
    terms: Any = (sp.csr_array(matrix) * near[None, :]).toarray()
    sizes = np.abs(terms).max(axis=1, initial=0.0)
    terms = terms / np.where(sizes > 0.0, sizes, 1.0)[:, None]
    order: Any = sl.qr(terms, mode="r", pivoting=True, check_finite=False)[1]
    return order.tolist()


def _pivots(integers: NDArray[Any], order: list[int], deadline: float) -> tuple[list[int], list[int], _Integers] | None:
    """Return rows and columns of a largest block that is regular modulo the prime, with its inverse there."""
    rows, _ = integers.shape
    residues = (integers % PRIME).astype(np.int64)
    work = np.concatenate([residues[:, order], np.eye(rows, dtype=np.int64)], axis=1)
    free = np.ones(rows, dtype=bool)
    chosen_rows, chosen_columns = list[int](), list[int]()
    for place, column in enumerate(order):
        if len(chosen_rows) == rows:
            break
        if time.perf_counter() > deadline:
            return None
        candidates = np.flatnonzero(free & (work[:, place] != 0))
        if candidates.size == 0:
            continue
        pivot = int(candidates[0])
        work[pivot] = work[pivot] * pow(int(work[pivot, place]), -1, PRIME) % PRIME
        others = np.flatnonzero(work[:, place])
        others = others[others != pivot]
        work[others] = (work[others] - work[others, place][:, None] * work[pivot]) % PRIME
        free[pivot] = False
        chosen_rows.append(pivot)
        chosen_columns.append(column)
    # row chosen_rows[i] of the work is now unit in column chosen_columns[i]; its right half combines those rows only
    inverse = work[np.ix_(chosen_rows, [len(order) + row for row in chosen_rows])]
    return chosen_rows, chosen_columns, inverse


def _lifted(block: NDArray[Any], inverse: _Integers, right: Rationals, deadline: float) -> Iterator[Rationals]:
    """Yield what may be the solution of `block` x = `right`, one p-adic digit after the other: the last one is it,
    unless time ends (digits end by the bounds of Hadamard and Cramer)."""
    common = math.lcm(*(value.denominator for value in right))
    rest = [value.numerator * (common // value.denominator) for value in right]
    limbs, modulus, digits, look = _limbs(block), 1, list[NDArray[Any]](), 8
    size = max(map(abs, [*block.ravel().tolist(), *rest]), default=0).bit_length() + len(right).bit_length()
    most = 2 * (len(right) + 1) * size + 2
    while modulus.bit_length() <= most:
        if time.perf_counter() > deadline:
            return
        digit = inverse @ np.array([value % PRIME for value in rest], dtype=np.int64) % PRIME
        digits.append(digit.astype(object))
        modulus *= PRIME
        products = zip(*((limb @ digit).tolist() for limb in limbs), strict=True)
        totals = (sum(part << (_LIMB * k) for k, part in enumerate(parts)) for parts in products)
        rest = [(value - total) // PRIME for value, total in zip(rest, totals, strict=True)]
        if len(digits) == look or modulus.bit_length() > most:
            look *= 2
            found = _fractions(_summed(digits).tolist(), modulus)
            if found is not None:
                yield [value / common for value in found]


def _summed(digits: list[NDArray[Any]]) -> NDArray[Any]:
    """Sum digitsᵢ PRIMEⁱ, the halves first: with one sum after the other the time would grow with the square."""
    if len(digits) == 1:
        return digits[0]
    half = len(digits) // 2
    return _summed(digits[:half]) + _summed(digits[half:]) * PRIME**half


def _limbs(block: NDArray[Any]) -> list[_Integers]:
    """Return the integers in base 2^24, signs with them."""
    sign = np.where(block < 0, -1, 1).astype(np.int64)
    left, limbs = abs(block), list[_Integers]()
    while left.any():
        limbs.append((left % 2**_LIMB).astype(np.int64) * sign)
        left = left // 2**_LIMB
    return limbs


def _fractions(digits: list[int], modulus: int) -> Rationals | None:
    """Return the fractions of least size with these residues; the denominator of the earlier ones is tried first."""
    bound = math.isqrt(modulus // 2)
    found: Rationals = []
    denominator = 1
    for digit in digits:
        fraction = _fraction(digit * denominator % modulus, modulus, bound)
        if fraction is None:
            return None
        found.append(fraction / denominator)
        denominator *= fraction.denominator
    return found


def _fraction(residue: int, modulus: int, bound: int) -> Fraction | None:
    """Return n/d = `residue` modulo `modulus` with |n| and d at most `bound` (Wang 1981); None without."""
    r0, r1, t0, t1 = modulus, residue, 0, 1
    while r1 > bound:
        quotient = r0 // r1
        r0, r1, t0, t1 = r1, r0 - quotient * r1, t1, t0 - quotient * t1
    return Fraction(r1, t1) if t1 and abs(t1) <= bound else None
