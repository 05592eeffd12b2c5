"""Linear systems over the rationals, against planted solutions and elimination in fractions."""

from __future__ import annotations

import time
from fractions import Fraction

import numpy as np
import pytest
import scipy.sparse as sp

from cpbench.proofs.exact_linear import PRIME, Exact, rationals, rounded, solve


def product(M: np.ndarray, x: list[Fraction]) -> list[Fraction]:
    return [sum((Fraction(v) * y for v, y in zip(row, x, strict=True)), Fraction(0)) for row in M.tolist()]


@pytest.mark.parametrize("sparse", [False, True])
def test_products_are_exact(sparse: bool) -> None:
    rng = np.random.default_rng(1)
    M = rng.standard_normal((6, 4)) * 10.0 ** rng.integers(-300, 300, (6, 4))
    M[rng.random(M.shape) < 0.3] = 0.0
    M[0, 0] = 5e-324
    x = [Fraction(int(n), int(d)) for n, d in zip(rng.integers(-99, 99, 4), rng.integers(1, 99, 4), strict=True)]
    y = rationals(rng.standard_normal(6))
    exact = Exact.of(sp.csr_array(M) if sparse else M)
    assert exact.times(x) == product(M, x)
    assert exact.transposed_times(y) == product(M.T, y)


@pytest.mark.parametrize("n", [1, 2, 7, 30, 100])
def test_regular_systems(n: int) -> None:
    rng = np.random.default_rng(n)
    A, b = rng.standard_normal((n, n)) * 2.0 ** rng.integers(-30, 30, (n, 1)), rng.standard_normal(n)
    x = solve(A, rationals(b), np.linalg.solve(A, b))
    assert x is not None
    assert Exact.of(A).times(x) == rationals(b)


def test_the_solution_of_two_equations_with_condition_1e12() -> None:
    A = np.array([[1.0, -1.0], [-1.0, 1.0 + 1.9e-12]])
    x = solve(A, [Fraction(1), Fraction(1)], np.zeros(2))
    determinant = Fraction(float(A[1, 1])) - 1
    assert x == [2 / determinant + 1, 2 / determinant]


def test_systems_with_many_solutions_keep_what_is_free() -> None:
    rng = np.random.default_rng(3)
    A = rng.integers(-3, 4, (5, 9)).astype(float)
    A[4] = A[0] + A[1]
    planted = rng.standard_normal(9)
    right = product(A, rationals(planted))
    x = solve(sp.csr_array(A), right, planted)
    assert x is not None
    assert product(A, x) == right
    assert max(abs(float(v) - w) for v, w in zip(x, planted, strict=True)) < 1e-5


def test_what_has_no_solution_has_none() -> None:
    A = np.array([[1.0, 2.0], [2.0, 4.0]])
    assert solve(A, [Fraction(1), Fraction(2) + Fraction(1, 2**300)], np.ones(2)) is None
    assert solve(np.zeros((1, 2)), [Fraction(1)], np.ones(2)) is None
    assert solve(np.zeros((0, 2)), [], np.ones(2)) == [Fraction(1), Fraction(1)]


def test_a_matrix_that_is_singular_modulo_the_prime_only() -> None:
    """Not solved, and nothing false said."""
    x = solve(np.array([[float(PRIME)]]), [Fraction(1)], np.zeros(1))
    assert x is None or x == [Fraction(1, PRIME)]


def test_a_deadline_is_kept() -> None:
    rng = np.random.default_rng(4)
    A = rng.standard_normal((40, 40))
    assert solve(A, rationals(np.ones(40)), np.zeros(40), time.perf_counter()) is None


def test_rounding_keeps_24_digits_of_every_component() -> None:
    assert rounded(np.zeros(2)) == [Fraction(0)] * 2
    x = [1.0, 2.0**-900 * (1.0 + 2.0**-40), -1.0 / 3.0]
    assert rounded(np.array(x)) == [Fraction(1), Fraction(1, 2**900), -Fraction(round(2**25 / 3), 2**25)]
