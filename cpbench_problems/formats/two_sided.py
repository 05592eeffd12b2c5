"""Rows and bounds with two sides, l ≤ Ax ≤ u, as the rows and bounds of a quadratic program."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from cpbench.errors import FormatError
from cpbench.foundation.matrices import Vector

INFINITE = 1e19
"""Sides from here on stand for none: 1e20 in Maros' and Meszaros' files, or 1e20 after a scaling of the row."""


def infinite(x: Vector) -> Vector:
    """Return sides with those of ±INFINITE and beyond made infinite."""
    return np.where(np.abs(x) >= INFINITE, np.copysign(np.inf, x), x)


def require_sides(path: Path, lower: Vector, upper: Vector, what: str) -> None:
    """Raise FormatError on a side that is no number, or an infinite one that nothing reaches."""
    bad = np.flatnonzero(np.isnan(lower) | np.isnan(upper) | (lower == np.inf) | (upper == -np.inf))
    if bad.size:
        i = int(bad[0])
        raise FormatError(
            path, f"row {i} of {what}", f"has the limits l = {lower[i]:g}, u = {upper[i]:g}, expected l < inf, u > -inf"
        )


def uncrossed(parts: dict[str, Any]) -> dict[str, Any]:
    """Return the data of a quadratic program in which each upper bound that is below the lower one is a row: nothing
    satisfies both, which is a problem without a solution and no damaged file."""
    crossed = np.flatnonzero(parts["lb"] > parts["ub"])
    if not crossed.size:
        return parts
    n = parts["lb"].size
    rows = sp.csr_array((-np.ones(crossed.size), (np.arange(crossed.size), crossed)), shape=(crossed.size, n))
    ub = parts["ub"].copy()
    A = sp.csr_array(sp.vstack([sp.csr_array(parts["A"]), rows], format="csr"))
    b, ub[crossed] = np.concatenate([parts["b"], -ub[crossed]]), np.inf
    return {**parts, "A": A, "b": b, "ub": ub}


def sides(lower: Vector, upper: Vector) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Return the numbers of the rows with a lower side, with an upper one, and of equations."""
    equal = lower == upper
    below, above = np.isfinite(lower) & ~equal, np.isfinite(upper) & ~equal
    return np.flatnonzero(below), np.flatnonzero(above), np.flatnonzero(equal)


def rows(A: sp.csr_array, lower: Vector, upper: Vector) -> dict[str, Any]:
    """Return A, b, C, d of the rows lower ≤ Az ≤ upper: equal sides give Cz = d, others Az ≥ b, one for each finite
    side."""
    below, above, equal = sides(lower, upper)
    return {
        "A": sp.csr_array(sp.vstack([A[below], -A[above]], format="csr")),
        "b": np.concatenate([lower[below], -upper[above]]),
        "C": A[equal],
        "d": lower[equal],
    }
