"""All solutions of a small LCP or MLCP, over the rationals: every complementary basis is looked at.

For each set B of pairs, x is sought with K x + c = w, w = 0 on the free unknowns and on B, x = 0 on the other pairs. A
regular system has one solution, whose signs decide. Of a singular one, the nonnegative solutions make a polyhedron: it
is empty, a point, or a continuum, and least-index pivots say which.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.sparse as sp
from flint import fmpq, fmpq_mat, fmpz_mat

from cpbench.formulations.base import Problem
from cpbench_lab.certificates.active_sets import BASIC, LOWER, States
from cpbench_lab.certificates.exact_rows import ExactRows
from cpbench_lab.certificates.mixed import Mixed, mixed

WORK = 1 << 20
"""The most bases times entries of K that are looked at, 12 pairs: a third of a second where few bases are singular."""
SECONDS = 10.0
"""Limit for numbers of very different sizes, and for many singular bases [s]."""


@dataclass(frozen=True, eq=False)
class AllSolutions:
    """The solutions of a problem.

    Attributes
    ----------
    points : different ones, exact, with the states of a basis of each; all there are where `endless` is None.
    endless : the states of a face of infinitely many, at whose first the search ends.
    """

    points: list[tuple[list[Any], States]]
    endless: States | None = None

    @property
    def count(self) -> float:
        """How many there are, infinity for a continuum."""
        return float(len(self.points)) if self.endless is None else np.inf


@lru_cache(maxsize=1)
def all_solutions(problem: Problem) -> AllSolutions | None:
    """Return all solutions of an LCP or MLCP; None where it is another problem, too large, or takes too long."""
    P = _small(problem)
    if P is None:
        return None
    points = dict[tuple[Any, ...], tuple[list[Any], States]]()
    try:
        for x, many, states in _of_all_bases(P):
            if many:
                return AllSolutions([], states)
            points.setdefault(_numbers(x), (x, states))
    except TimeoutError:
        return None
    return AllSolutions(list(points.values()))


def basic_solutions(problem: Problem) -> list[list[Any]] | None:
    """Return the different solutions that are the only one of some complementary basis: of a continuum its ends, where
    bases there are regular. None as of `all_solutions`."""
    P = _small(problem)
    if P is None:
        return None
    try:
        solutions = {_numbers(x): x for x, many, _ in _of_all_bases(P) if not many}
    except TimeoutError:
        return None
    return list(solutions.values())


def _numbers(x: Sequence[Any]) -> tuple[Any, ...]:
    return tuple((int(v.p), int(v.q)) for v in x)


def _small(problem: Problem) -> Mixed | None:
    """Return an LCP or MLCP of which all bases can be looked at; None for another problem."""
    form = mixed(problem, problem.zero_point()) if problem.node in ("lcp", "mlcp") else None
    if form is None or 2 ** min(int(np.isfinite(form[0].lo).sum()), 99) * max(form[0].c.size, 1) ** 2 > WORK:
        return None
    return form[0]


def _of_all_bases(P: Mixed) -> Iterator[tuple[list[Any], bool, States]]:
    """Yield a solution of each complementary basis that has one, whether it has infinitely many, and its states.

    Raises TimeoutError after SECONDS.
    """
    pairs = np.flatnonzero(np.isfinite(P.lo)).tolist()
    free = np.flatnonzero(~np.isfinite(P.lo)).tolist()
    table, began = _integers(P), time.perf_counter()
    for number in range(2 ** len(pairs)):
        if time.perf_counter() - began > SECONDS:
            raise TimeoutError
        basic = {j for k, j in enumerate(pairs) if number >> k & 1}
        x, many = _of_basis(table, free, pairs, basic)
        if x is not None:
            states = np.full(P.c.size, LOWER, dtype=np.int8)
            states[[*free, *basic]] = BASIC
            yield x, many, states


def _integers(P: Mixed) -> list[list[int]]:
    """Rows of K and c, each times a power of two."""
    exact = ExactRows.of(sp.csr_array(sp.hstack([P.K, sp.csr_array(P.c[:, None])])))
    table = [[0] * (P.c.size + 1) for _ in range(P.c.size)]
    for row, columns, values in zip(table, exact.columns, exact.values, strict=True):
        for j, value in zip(columns, values, strict=True):
            row[j] = value
    return table


def _of_basis(
    table: list[list[int]], free: list[int], pairs: list[int], basic: set[int]
) -> tuple[list[Any] | None, bool]:
    """Return a solution with these basic unknowns, None where none is, and whether they are infinitely many."""
    n, used = len(table), [*free, *sorted(basic)]
    x = [fmpq(0)] * n
    if used:
        block = fmpq_mat(fmpz_mat([[table[i][j] for j in used] for i in used]))
        try:
            found = block.solve(fmpq_mat(fmpz_mat([[-table[i][n]] for i in used])), algorithm="fflu").entries()
        except ZeroDivisionError:
            return _of_singular(table, free, pairs, basic)
        if any(v < 0 for v in found[len(free) :]):
            return None, False
        for j, value in zip(used, found, strict=True):
            x[j] = value
    for i in pairs:
        if i not in basic and sum((x[j] * table[i][j] for j in used), fmpq(table[i][n])) < 0:
            return None, False
    return x, False


def _of_singular(
    table: list[list[int]], free: list[int], pairs: list[int], basic: set[int]
) -> tuple[list[Any] | None, bool]:
    """Return the same where the system is singular: a column for each free unknown and for xⱼ or wⱼ of each pair."""
    n = len(table)
    columns = [[row[j] for row in table] for j in free]
    columns += [[row[j] for row in table] if j in basic else [-int(i == j) for i in range(n)] for j in pairs]
    found = nonnegative(columns, [-row[n] for row in table], set(range(len(free))))
    if found is None:
        return None, False
    # another solution differs by d, Ad = 0, which is ≥ 0 where this one is 0; it is a vertex but for the free part
    zero = [k for k, v in enumerate(found) if k >= len(free) and v == 0]
    loose = set(range(len(columns))) - set(zero)
    away = [[*column, int(k in zero)] for k, column in enumerate(columns)]
    many = _rank(columns, sorted(loose)) < len(loose) or nonnegative(away, [0] * n + [1], loose) is not None
    x = [fmpq(0)] * n
    for j, value in zip([*free, *pairs], found, strict=True):
        x[j] = value if j in basic or j in free else fmpq(0)
    return x, many


def _rank(columns: Sequence[Sequence[int]], some: list[int]) -> int:
    return fmpz_mat([list(columns[k]) for k in some]).rank() if some else 0


def nonnegative(columns: Sequence[Sequence[int]], right: list[int], free: set[int]) -> list[Any] | None:
    """Return y with Σ columns·y = right, y ≥ 0 but where it is free, at a vertex; None where there is none.

    Pivots by least index (Terlaky: A convergent criss-cross method, Optimization 16, 1985), which end.
    """
    order = [*sorted(free), *(k for k in range(len(columns)) if k not in free)]
    rows = [list(row) for row in zip(*(columns[k] for k in order), right, strict=True)]
    reduced: Any
    reduced, rank = fmpq_mat(fmpz_mat(rows)).rref()
    T = reduced.tolist()[: int(rank)]
    basis = [next(k for k, v in enumerate(row) if v != 0) for row in T]
    if len(order) in basis:
        return None  # a row says 0 = 1
    signed = len(free)
    while True:
        leaving = min(
            (r for r, k in enumerate(basis) if k >= signed and T[r][-1] < 0), key=basis.__getitem__, default=-1
        )
        if leaving < 0:
            break
        pivot = next((k for k in range(signed, len(order)) if T[leaving][k] < 0), -1)
        if pivot < 0:
            return None
        own = [v / T[leaving][pivot] for v in T[leaving]]
        T = [own if r == leaving else _less(row, own, row[pivot]) for r, row in enumerate(T)]
        basis[leaving] = pivot
    y = [fmpq(0)] * len(order)
    for row, k in zip(T, basis, strict=True):
        y[order[k]] = row[-1]
    return y


def _less(row: list[Any], other: list[Any], factor: Any) -> list[Any]:
    return row if factor == 0 else [a - factor * b for a, b in zip(row, other, strict=True)]
