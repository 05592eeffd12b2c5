"""LCPs with the patterns of physics-based animation against loops as num4lcp has them, and exact arithmetic."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from cpbench.formulations.linear import LCP, LCPPoint
from cpbench.foundation.matrices import dense
from cpbench.generators.base import Instance, generator
from cpbench_problems.generators.animation import BLOCK, LEAST, blocked, contact, contact_pattern, fluid


@pytest.mark.parametrize("instance", [fluid(4), contact(10)], ids=lambda instance: instance.name)
def test_what_is_planted_is_a_solution_in_exact_arithmetic(instance: Instance) -> None:
    problem, point = instance.problem, instance.solution
    assert isinstance(problem, LCP)
    assert isinstance(point, LCPPoint)
    z = [Fraction(value) for value in point.z.tolist()]
    for row, q, own in zip(dense(problem.M).tolist(), problem.q.tolist(), z, strict=True):
        w = Fraction(q) + sum(Fraction(m) * value for m, value in zip(row, z, strict=True))
        assert min(own, w) == 0


def test_the_least_eigenvalue_of_the_bands_is_as_said() -> None:
    """It is above that of the infinite matrix, and tends to it: the first eigenvector is a sine of n + 1 points."""
    problem = fluid(10).problem
    assert isinstance(problem, LCP)
    M = dense(problem.M)
    assert (M == M.T).all()
    assert np.count_nonzero(M) == 7 * 1000 - 2 * (1 + 2 + 3)
    assert LEAST < np.linalg.eigvalsh(M)[0] < LEAST + 1e-3


def test_blocks_are_shifted_and_half_of_them_are_zero() -> None:
    A = blocked(generator(1), 30)
    least = np.linalg.eigvalsh(A)[0]
    assert LEAST - 1e-9 <= least <= LEAST + 0.125 + 1e-9
    blocks = A.reshape(30, BLOCK, 30, BLOCK).transpose(0, 2, 1, 3)
    assert 0.4 < np.mean([[block.any() for block in row] for row in blocks]) < 0.6


def test_the_pattern_is_that_of_num4lcp() -> None:
    """Its loop over blocks, with indices from 1: rows i, i+1..i+4, i+5 are normal, friction and slack."""
    A = blocked(generator(2), 4)
    expected = A.copy()
    for i in range(0, 24, 6):
        for j in range(0, 24, 6):
            if expected[i, j] != 0:
                expected[i + 5, j] = 0.5
                expected[i + 5, j + 5] = 0
                expected[i, j + 5] = 0
                for k in range(1, 5):
                    expected[i + 5, j + k] = -1
                    expected[i + k, j + 5] = 1
    np.testing.assert_array_equal(contact_pattern(A), expected)
    assert (contact_pattern(A) != A).any()
