"""Natural map with every row and unknown in its own unit: what an iterate must meet before it counts as an answer.

‖z − P(z − F)‖ over one size hides a miss in rows that are small beside others, as are prices beside quantities, and an
unknown that is nearly 0 where a row feels it, as a price beside a pole. So it is only what methods descend by.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench.foundation.cones import box_defect
from cpbench.foundation.matrices import Vector

SMALL = 1e-3
"""A row is measured by no less than this share of the largest: a smaller one has its error from others, by rounding."""
LEAST = 1e-6
"""Least size that is compared with: terms may all vanish at a solution, and what they leave with them."""


def row_error(z: Vector, F: Vector, slope: Any, lb: Vector, ub: Vector) -> float:
    """Return the largest natural map of a pair on the bounds; ∞ where that is not a number. slope : F′(z), sparse.

    A row is measured by the size of its terms, the sum of those in F′(z)z or what is left, F − F′(z)z; an unknown by
    its largest effect on a row. A row that holds its unknown at a bound is not a size for others.
    """
    if not z.size:
        return 0.0
    with np.errstate(all="ignore"):
        size = abs(slope)
        terms = np.maximum(size @ np.abs(z), np.abs(F - slope @ z))
        free = np.abs(F) <= 2.0 * np.abs(box_defect(z, F, lb, ub))
        unit = 1.0 / np.maximum(terms, max(SMALL * float(terms[free].max(initial=0.0)), LEAST))
        effect = size.multiply(unit[:, None]).max(axis=0).toarray().ravel()
        effect[effect == 0.0] = 1.0
        error = float(np.abs(box_defect(effect * z, unit * F, effect * lb, effect * ub)).max())
    return error if np.isfinite(error) else np.inf
