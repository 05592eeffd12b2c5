"""LCPs with the patterns of physics-based animation against loops as num4lcp has them, and exact arithmetic."""

from __future__ import annotations

import numpy as np

from cpbench.formulations.linear import LCP
from cpbench.foundation.matrices import dense
from cpbench.generators.base import generator
from cpbench_problems.generators.animation import LEAST, blocked, contact_pattern, fluid


def test_the_least_eigenvalue_of_the_bands_is_as_said() -> None:
    """It is above that of the infinite matrix, and tends to it: the first eigenvector is a sine of n + 1 points."""
    problem = fluid(10).problem
    assert isinstance(problem, LCP)
    M = dense(problem.M)
    assert (M == M.T).all()
    assert np.count_nonzero(M) == 7 * 1000 - 2 * (1 + 2 + 3)
    assert LEAST < np.linalg.eigvalsh(M)[0] < LEAST + 1e-3


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
