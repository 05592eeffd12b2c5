"""Natural map with every row and unknown in its own unit: what an iterate must meet before it counts as an answer.

‖z − P(z − F)‖ over one size hides a miss in rows that are small beside others, as are prices beside quantities, and an
unknown that is nearly 0 where a row feels it, as a price beside a pole. So it is only what methods descend by.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.formulations.conic import cone_defect
from cpbench.foundation.cones import Cone, ProductCone, box_defect
from cpbench.foundation.matrices import Vector

SMALL = 1e-3
"""A row is measured by no less than this share of the largest: a smaller one has its error from others, by rounding."""
LEAST = 1e-6
"""Least size that is compared with: terms may all vanish at a solution, and what they leave with them."""


def row_error(z: Vector, F: Vector, slope: Any, lb: Vector, ub: Vector, K: ProductCone | None = None) -> float:
    """Return the largest natural map of a pair on the bounds and in the factors of K, if any; ∞ where that is not a
    number. slope : F′(z), sparse.

    A row is measured by the size of its terms, the sum of those in F′(z)z or what is left, F − F′(z)z; an unknown by
    its largest effect on a row; a factor by its largest ones. A row that holds its unknown at a bound is not a size for
    others.
    """
    if not z.size:
        return 0.0
    with np.errstate(all="ignore"):
        size, far = sp.csr_array(abs(slope)), np.abs(z)
        terms = _largest(np.maximum(size @ far, np.abs(F - slope @ z)), K)
        free = _largest(np.abs(F), K) <= 2.0 * _largest(np.abs(_defect(z, F, lb, ub, K)), K)
        unit = 1.0 / np.maximum(terms, max(SMALL * float(terms[free].max(initial=0.0)), LEAST))
        effect = _largest(size.multiply(unit[:, None]).max(axis=0).toarray().ravel(), K)
        effect[effect == 0.0] = 1.0
        scaled = None if K is None else K.in_units(effect)
        defect = np.abs(_defect(effect * z, unit * F, effect * lb, effect * ub, scaled))
        error = float((defect if K is None else np.sqrt(np.bincount(K.blocks, defect**2))).max())
    return error if np.isfinite(error) else np.inf


def _defect(z: Vector, F: Vector, lb: Vector, ub: Vector, K: ProductCone | None) -> Vector:
    inside = box_defect(z, F, lb, ub)
    if K is None:
        return inside
    free = np.repeat(K.kind == Cone.FREE, K.size.astype(np.int64))
    return np.where(free, inside, cone_defect(K, z, F))


def _largest(x: Vector, K: ProductCone | None) -> Vector:
    """Return the largest of x ≥ 0 in the factor of each component."""
    if K is None:
        return x
    top = np.zeros(int(K.blocks[-1]) + 1)
    np.maximum.at(top, K.blocks, x)
    return top[K.blocks]
