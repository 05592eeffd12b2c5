"""References of convex QPs: the optimal value by two methods that share no code."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import qp_backends
from qp_literature import Literature, Reference, literature, objective_terms

Answers = list[tuple[str, Any]]

OWN_DIGITS = 1e-9
"""Largest gap between the primal and the dual objective of a reference, over the terms of the objective."""
MISSED = 1e-9
"""Largest number of the literature (over the largest terms) of a reference."""
CANCELLED = 1e-9
"""Terms of the objective that are a smaller share of Σ|z_i||Q_ij||z_j| + Σ|p_i z_i| are what rounding leaves of 0."""
AGREED = 1e-8
"""Largest difference of two methods' objectives, over the terms of the objective."""


def method(label: str) -> str:
    return label.split()[0]


def _worst(found: Literature) -> float:
    """Return what orders candidates: the gap over its terms with the rows, bounds and the gradient."""
    return max(found.rows_norm, found.bounds, found.gradient_norm, found.gap_terms)


def agreed(problem: Any, found: Iterable[tuple[str, Any, Literature]]) -> Reference | None:
    """Return the best answer whose objective another method confirms, None where there is none.

    `found` : labelled answers with their numbers of the literature. The best has a gap of OWN_DIGITS; the other one
    is of another method, right to AGREED by the literature, and their objectives differ by at most AGREED.
    """
    good = sorted(
        ((_worst(numbers), label, point, numbers) for label, point, numbers in found),
        key=lambda row: (row[0], row[1]),
    )
    good = [row for row in good if row[0] <= AGREED]
    if not good or good[0][3].gap_terms > OWN_DIGITS or good[0][0] > MISSED:
        return None
    _, label, point, numbers = good[0]
    terms = objective_terms(problem, point.z)
    size = np.abs(point.z)
    if not terms > CANCELLED * (float(size @ (abs(problem.Q) @ size)) + float(np.abs(problem.p) @ size)):
        return None  # an optimal value of 0 has no terms that an error could be compared with
    for _, other, _, others in good:
        if method(other) != method(label) and abs(others.objective - numbers.objective) <= AGREED * terms:
            return Reference(point.z, numbers.objective, terms, f"{label}, {other}")
    return None


def collect(problem: Any, seconds: float) -> tuple[Answers, Reference | None]:
    """Return the different answers of many solvers to a QP, labelled, and its reference."""
    different: dict[bytes, tuple[str, Any]] = {}
    for label, point in qp_backends.answers(problem, seconds):
        different.setdefault(point.vector.tobytes(), (label, point))
    answers = list(different.values())
    return answers, agreed(problem, ((label, point, literature(problem, point)) for label, point in answers))
