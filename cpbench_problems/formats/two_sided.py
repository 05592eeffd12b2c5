"""Rows and bounds with two sides, l ≤ Ax ≤ u, as the rows and bounds of a quadratic program."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.errors import FormatError
from cpbench.foundation.matrices import Vector

INFINITE = 1e19
"""Sides from here on stand for none: 1e20 in Maros' and Meszaros' files, or 1e20 after a scaling of the row."""


def infinite(x: Vector) -> Vector:
    """Return sides with those of ±INFINITE and beyond made infinite."""
    return np.where(np.abs(x) >= INFINITE, np.copysign(np.inf, x), x)


def require_order(path: Path, lower: Vector, upper: Vector, what: str) -> None:
    """Raise FormatError on a pair of sides that nothing can satisfy."""
    bad = np.flatnonzero(np.isnan(lower) | np.isnan(upper) | (lower > upper) | (lower == np.inf) | (upper == -np.inf))
    if bad.size:
        i = int(bad[0])
        raise FormatError(
            path, f"row {i} of {what}", f"has the limits l = {lower[i]:g}, u = {upper[i]:g}, expected l <= u"
        )


def rows(A: sp.csr_array, lower: Vector, upper: Vector) -> dict[str, Any]:
    """Return A, b, C, d of the rows lower ≤ Az ≤ upper: equal sides give Cz = d, others Az ≥ b, one for each finite
    side."""
    equal = np.flatnonzero(lower == upper)
    other = np.flatnonzero(lower != upper)
    below, above = other[np.isfinite(lower[other])], other[np.isfinite(upper[other])]
    return {
        "A": sp.csr_array(sp.vstack([A[below], -A[above]], format="csr")),
        "b": np.concatenate([lower[below], -upper[above]]),
        "C": A[equal],
        "d": lower[equal],
    }


def rows_and_bounds(path: Path, A: sp.csr_array, lower: Vector, upper: Vector) -> dict[str, Any]:
    """Return A, b, C, d, lb, ub of the rows lower ≤ Az ≤ upper; one variable with coefficient 1 makes a bound of it.

    The files of Maros and Meszaros keep their bounds as such rows, the last ones. Raises FormatError on a row that
    nothing can satisfy.
    """
    lower, upper = infinite(lower), infinite(upper)
    require_order(path, lower, upper, "A")
    n = A.shape[1]
    lb, ub = np.full(n, -np.inf), np.full(n, np.inf)
    single = np.flatnonzero(np.diff(A.indptr) == 1)
    single = single[A.data[A.indptr[single]] == 1.0]
    variable = A.indices[A.indptr[single]]
    np.maximum.at(lb, variable, lower[single])
    np.minimum.at(ub, variable, upper[single])
    rest = np.setdiff1d(np.arange(A.shape[0]), single)
    return {**rows(A[rest], lower[rest], upper[rest]), "lb": lb, "ub": ub}
