"""Checks of answers that solvers claim to have."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from cpbench.verification import judge

NEAR = 100.0
"""The verdict measures every part and row in its own size, solvers stop by norms of the whole: the two differ by less
than this where the parts and rows of a problem are of similar size."""


def assert_own_measure(problem: Any, point: Any, tolerance: float) -> None:
    """Assert that an answer meets the tolerance by the published measures, which solvers stop by."""
    error = problem.residuals(point, tolerance).error
    assert error <= tolerance, f"{problem.name}: error {error:.3g} by the solver's own measure, claimed {tolerance:.3g}"


def assert_claim(problem: Any, point: Any, tolerance: float) -> None:
    """Assert that an answer meets the tolerance by the published measures, and that its backward error is near."""
    assert_own_measure(problem, point, tolerance)
    error = judge(problem, point, tolerance).error
    assert error <= NEAR * tolerance, f"{problem.name}: backward error {error:.3g}, claimed {tolerance:.3g}"


def row_error(K: np.ndarray, k: np.ndarray, x: np.ndarray, free: int = 0, *, whole: bool = False) -> float:
    """Return the largest error of a row by its terms, or a thousandth of the largest of its connected part (`whole`: of
    all, beside columns of like size); the first `free` rows are equalities."""
    C = np.linalg.norm(K, axis=0)
    w, R, felt = K @ x + k, np.linalg.norm(K if whole else K / np.where(C > 0, C, 1), axis=1), abs(K) @ abs(x)
    pair = np.arange(k.size) >= free
    compared = np.where(pair & (x == 0) & (w > 0), felt, np.maximum(felt, abs(k))) / R
    label = np.zeros(k.size, int) if whole else connected_components(sp.csr_array(K))[1]
    top = np.array([compared[label == part].max() for part in label])
    size = np.maximum(np.maximum(felt, abs(k)), 1e-3 * R * top)
    x_hat, w_hat = x * (abs(K) / size[:, None]).max(axis=0), w / size
    errors = np.where(pair, abs(np.minimum(x_hat, w_hat)), abs(w_hat))
    return float(errors[k != 0].max(initial=0.0))
