"""Similarity of problems, by their features.

Distances are root mean squares over the features that either problem has, each over its standard deviation: of
logarithms for sizes and scales, one unit where only one problem has it, at most CUT.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from cpbench.analysis.table import Floats, Masks, Matrix
from cpbench.analysis.training_cases import TrainingCases
from cpbench.matrices import SYMMETRY_TOLERANCE

CUT = 3.0
_COUNTS = ("equalities", "inequalities", "bounds", "deficiency")
_LOGARITHMS = (
    "unknowns", "nnz", "entries", "nc", "ndof", "spread", "condition", "hyperstatic", "rank", "dimension", *_COUNTS,
)  # fmt: skip
_SHARES = (
    "density", "dominant", "negative_couplings", "zero_diagonal", "negative_diagonal", "driven", "mu_median", "mu_max",
    "frictionless",
)  # fmt: skip
_SIGNS: Mapping[str, float] = {"asymmetry": SYMMETRY_TOLERANCE, "least_eigenvalue": 1e-9}
"""Features of which the sign counts, beyond this much."""
_FEATURES = len(_LOGARITHMS) + len(_SHARES) + len(_SIGNS)
_LEAST_DEVIATION = 0.25


def places(known: TrainingCases) -> Matrix:
    """Return the coordinates of every case, cases × features."""
    return np.array([coordinates(case.features) for case in known.cases]).reshape(len(known.cases), _FEATURES)


def distances(queries: Matrix, theirs: Matrix, used: Masks) -> Matrix:
    """Return d of every case from every query problem, queries × cases, in deviations of the cases that are used."""
    there = ~np.isnan(theirs) & used[:, None]
    count = np.maximum(there.sum(axis=0), 1)
    mean = np.where(there, theirs, 0.0).sum(axis=0) / count
    spread = np.sqrt((np.where(there, theirs - mean, 0.0) ** 2).sum(axis=0) / count)
    unit = np.maximum(spread, _LEAST_DEVIATION)
    total, either = (np.zeros((len(queries), len(theirs))) for _ in range(2))
    for feature in range(_FEATURES):
        ours, others = queries[:, feature, None] / unit[feature], theirs[None, :, feature] / unit[feature]
        one, other = ~np.isnan(ours), ~np.isnan(others)
        apart = np.where(one & other, np.minimum(np.abs(others - ours), CUT), 1.0)
        total += np.where(one | other, apart**2, 0.0)
        either += one | other
    return np.sqrt(total / np.maximum(either, 1))


def coordinates(features: Mapping[str, Any]) -> Floats:
    """Return the features as numbers that may be subtracted; NaN for one that is not there."""
    found: list[float] = []
    for name in _LOGARITHMS:
        value = float(features.get(name, math.nan)) + (name in _COUNTS)
        found.append(math.log10(value) if value > 0 else math.nan)
    found += [float(features.get(name, math.nan)) for name in _SHARES]
    for name, least in _SIGNS.items():
        value = float(features.get(name, math.nan))
        found.append(math.copysign(float(abs(value) > least), value) if value == value else math.nan)
    return np.array(found)
