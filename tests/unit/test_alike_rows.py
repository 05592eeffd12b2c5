"""Answers to programs in which two rows are nearly the same: their difference decides, and is known or not."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from cpbench.formulations import QP, QPPoint
from cpbench.verification import judge
from cpbench.verification.rows import AlikeRows


def beside_its_twin(rng: np.random.Generator, digits: int, kind: str) -> tuple[QP, QPPoint, QPPoint]:
    """Return ½|z − g|² where aᵀz = b (or only ≤ b) beside a row that differs from it by δ = 10^-digits in one entry and
    in its side, so that z₁ ≥ c follows; its solution; and that without the second row.

    Numbers are small integers over powers of 2: both rows hold the solution exactly, by rational arithmetic.
    """
    n, delta = int(rng.integers(3, 8)), 2.0 ** -round(digits * np.log2(10.0))
    a, g = rng.integers(1, 5, n).astype(float), rng.integers(-4, 5, n).astype(float)
    c = g[0] + 8.0  # far beyond what the objective wants
    target = g + (float(a @ a) - a @ g) / float(a @ a) * a  # aᵀz = aᵀa
    z = g.copy()
    z[0] = c
    rest = float(a @ a) - a[0] * c - a[1:] @ g[1:]
    z[1:] += rest / float(a[1:] @ a[1:]) * a[1:]
    # ∇ = z − g = μa + λδe₁
    mu = rest / float(a[1:] @ a[1:])
    lam = (z[0] - g[0] - mu * a[0]) / delta
    twin = a.copy()
    twin[0] += delta
    b = float(a @ a)
    side = b + delta * c
    if kind == "equality":
        problem = QP.build(np.eye(n), -g, twin[None], np.array([side]), a[None], np.array([b]))
        right = QPPoint(z, np.array([lam]), np.array([mu - lam]), np.zeros(n))
        loose = QPPoint(target, np.zeros(1), np.array([(b - a @ g) / float(a @ a)]), np.zeros(n))
    else:
        problem = QP.build(np.eye(n), -g, np.vstack([twin, -a]), np.array([side, -b]))
        right = QPPoint(z, np.array([lam, lam - mu]), np.zeros(0), np.zeros(n))
        y = (b - a @ g) / float(a @ a)
        loose = QPPoint(target, np.array([max(y, 0.0), max(-y, 0.0)]), np.zeros(0), np.zeros(n))
    exact = sum((Fraction(t) * Fraction(x) for t, x in zip(twin - a, z, strict=True)), Fraction(0))
    assert abs(exact / Fraction(delta) - Fraction(c)) < Fraction(1, 10**9)
    return problem, right, loose


@pytest.mark.parametrize("kind", ["equality", "both sides"])
@pytest.mark.parametrize("digits", [6, 9, 12])
@pytest.mark.parametrize("seed", range(5))
def test_only_answers_that_know_the_difference_are_solved(seed: int, digits: int, kind: str) -> None:
    problem, right, loose = beside_its_twin(np.random.default_rng(seed), digits, kind)
    for tolerance in (1e-4, 1e-6, 1e-8):
        verdict = judge(problem, right, tolerance)
        assert verdict.solved or "unresolvable" in verdict.flags, verdict
        assert "ill-posed" not in verdict.flags
        verdict = judge(problem, loose, tolerance)
        assert not verdict.solved
        assert "ill-posed" in verdict.flags
    assert judge(problem, loose, 10.0**-digits * 1e3).error <= 10.0**-digits * 1e3


@pytest.mark.parametrize(("times", "named"), [(0.5, False), (2.0, True)])
def test_two_digits_of_a_difference_must_be_known(times: float, named: bool) -> None:
    """`ILL_POSED`: z₂ = 1 and (1 + δ) z₂ + δ z₁ ≥ 1 + 2δ, hence z₁ ≥ 1, missed by so many hundredths of its terms."""
    delta = 2.0**-20
    problem = QP.build(
        np.eye(2), np.zeros(2), np.array([[delta, 1.0 + delta]]), np.array([1.0 + 2 * delta]),
        np.array([[0.0, 1.0]]), np.ones(1),
    )  # fmt: skip
    missed = times * 1e-2 * 2.0  # terms: 1 of z₁ and 1 of the side
    point = QPPoint(np.array([1.0 - missed, 1.0]), np.zeros(1), np.zeros(1), np.zeros(2))
    assert ("ill-posed" in judge(problem, point, 1e-4).flags) == named


@pytest.mark.parametrize(("times", "found"), [(0.9, True), (1.1, False)])
def test_rows_that_differ_by_more_are_not_alike(times: float, found: bool) -> None:
    G: Any = np.array([[1.0, 0.0], [1.0, times * 1e-2]])
    assert (AlikeRows.of(G, np.zeros(4), np.ones(4), np.ones(4)) is not None) == found


def test_rows_that_are_the_same_are_no_pair() -> None:
    """Multiples of a row, to rounding, say the same."""
    row = np.random.default_rng(0).standard_normal(6)
    assert AlikeRows.of(np.vstack([row, -3.0 * row, row / 7.0]), np.zeros(9), np.ones(9), np.ones(9)) is None
