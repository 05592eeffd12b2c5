"""Bounds lb ≤ z ≤ ub, and the sizes that errors are measured against: none of them may be set by data or answers that
have no part in the error."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from cpbench.errors import ProblemError
from cpbench.foundation.cones import box_defect
from cpbench.foundation.matrices import Matrix, Vector, freeze, max_abs, norm


def least(*sizes: float) -> float:
    """Return the smallest positive of the numbers, 0 where there is none."""
    return min((size for size in sizes if size > 0), default=0.0)


def ratio(size: float, per: float) -> float:
    """Return size / per, 0 where nothing can be said."""
    return size / per if per > 0 else 0.0


def row_sizes(A: Matrix, groups: Any = None) -> Vector:
    """Return max|A_ij| of every row, 1 for a zero row; with `groups` (the group of every row) the largest of its group.

    A row divided by its size has the units of the unknowns, and its multiplier times it those of the forces.
    """
    largest = np.zeros(A.shape[0])
    if sp.issparse(A):
        coo: Any = sp.coo_array(A)
        np.maximum.at(largest, coo.row, np.abs(coo.data))
    elif A.shape[1]:
        largest = np.abs(A).max(axis=1)
    if groups is not None:
        largest = group_max(largest, groups)[groups]
    return np.where(largest > 0, largest, 1.0)


def group_max(x: Vector, groups: Any) -> Vector:
    """Return max|x_i| over every group; groups are numbered from 0."""
    result = np.zeros(int(groups[-1]) + 1 if len(groups) else 0)
    np.maximum.at(result, groups, np.abs(x))
    return result


def least_squares(apply: Any, b: Vector) -> Vector:
    """Return the shortest x with ‖Ax − b‖ least, by LSMR, for a matrix or operator A that is singular; to about
    1e-8."""
    return freeze(np.asarray(spla.lsmr(apply, b, atol=1e-12, btol=1e-12, maxiter=1000)[0]))


def check_bounds(node: str, lb: Vector, ub: Vector) -> None:
    """Raise ProblemError where lb > ub or a bound is infinite on the wrong side."""
    if (lb > ub).any():
        i = int(np.flatnonzero(lb > ub)[0])
        raise ProblemError(f"{node}.lb", f"exceeds ub at {i}: {lb[i]:g} > {ub[i]:g}, so that there is no solution")
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
