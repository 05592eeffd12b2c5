"""Conditions and measures of problems with bounds lb ≤ z ≤ ub."""

from __future__ import annotations

import numpy as np

from cpbench.cones import project_box
from cpbench.errors import ProblemError
from cpbench.matrices import Vector, norm


def check_bounds(node: str, lb: Vector, ub: Vector) -> None:
    """Raises ProblemError where lb > ub or a bound is infinite on the wrong side."""
    if (lb > ub).any():
        i = int(np.flatnonzero(lb > ub)[0])
        raise ProblemError(f"{node}.lb", f"exceeds ub at {i}: {lb[i]:g} > {ub[i]:g}")
    for name, bad in (("lb", lb == np.inf), ("ub", ub == -np.inf)):
        if bad.any():
            raise ProblemError(f"{node}.{name}", f"is infinite on the wrong side at {int(np.flatnonzero(bad)[0])}")


def box_residuals(z: Vector, w: Vector, lb: Vector, ub: Vector, z_scale: float, w_scale: float) -> float:
    """‖z′ − P_[lb′,ub′](z′ − w′)‖ with z, lb, ub over z_scale and w over w_scale (1 where a scale is 0).

    It is ‖min(z′, w′)‖ for lb = 0 and ub = ∞, and does not change with the units of z and w.
    """
    z_scale, w_scale = z_scale or 1.0, w_scale or 1.0
    z = z / z_scale
    return norm(z - project_box(z - w / w_scale, lb / z_scale, ub / z_scale))
