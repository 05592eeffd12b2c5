"""Conditions and measures of problems with bounds lb ≤ z ≤ ub."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cpbench.errors import ProblemError
from cpbench.foundation.cones import box_defect
from cpbench.foundation.matrices import Vector, max_abs, norm


def check_bounds(node: str, lb: Vector, ub: Vector) -> None:
    """Raise ProblemError where lb > ub or a bound is infinite on the wrong side."""
    if (lb > ub).any():
        i = int(np.flatnonzero(lb > ub)[0])
        raise ProblemError(f"{node}.lb", f"exceeds ub at {i}: {lb[i]:g} > {ub[i]:g}")
    for name, bad in (("lb", lb == np.inf), ("ub", ub == -np.inf)):
        if bad.any():
            raise ProblemError(f"{node}.{name}", f"is infinite on the wrong side at {int(np.flatnonzero(bad)[0])}")


def box_residuals(z: Vector, w: Vector, lb: Vector, ub: Vector, z_scale: float | Vector, w_scale: float) -> float:
    """Return ‖z′ − P_[lb′,ub′](z′ − w′)‖₂ with z, lb, ub over z_scale and w over w_scale (1 where a scale is 0).

    All vectors are (n,), the scales numbers or (n,); the result has no unit.

    It is ‖min(z′, w′)‖ for lb = 0 and ub = ∞, and does not change with the units of z and w.
    """
    z_scale = np.where(np.asarray(z_scale) > 0, z_scale, 1.0)
    return norm(box_defect(z / z_scale, w / (w_scale or 1.0), lb / z_scale, ub / z_scale))


def top(x: Vector, moving: NDArray[np.bool_]) -> float:
    """Return max|x| over the unknowns that can move (lb < ub): what is fixed takes any force, however large."""
    return max_abs(x[moving])


def largest_in_box(lb: Vector, ub: Vector, moving: NDArray[np.bool_]) -> float:
    """Return max|z| over the box of the moving unknowns, 0 where it is unbounded."""
    bound = np.maximum(np.abs(lb[moving]), np.abs(ub[moving]))
    return float(bound.max(initial=0.0)) if np.isfinite(bound).all() else 0.0


def own_scale(z_scale: float, lb: Vector, moving: NDArray[np.bool_]) -> Vector:
    """Return z_scale for what moves; for what is fixed its own value, if that is larger."""
    return np.where(moving, z_scale, np.maximum(z_scale, np.abs(lb)))
