"""Checks of answers that solvers claim to have."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.verification import judge
from cpbench_solvers.contact.parts import MeasuredParts, connected_parts, rows_of_blocks

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


def compiled_error(problem: Any, r: Any) -> float:
    """Return the error of reactions by which solvers of local contact problems end, of the worst connected part."""
    parts, label = connected_parts(problem), np.empty(problem.nc, np.int64)
    for k, contacts in enumerate(parts):
        label[contacts] = k
    return float(MeasuredParts(rows_of_blocks(problem), label, len(parts)).errors(r).max(initial=0.0))
