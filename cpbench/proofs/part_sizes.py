"""The size of a connected part of a problem: its largest side that 0 does not meet, in units in which rows and columns
have a mean of one.

Sides that 0 meets (limits that are never reached, mostly) count by IDLE. A row or an unknown without entries has no
such unit, and is compared with all sides and bounds as they are written.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from cpbench.foundation.matrices import Matrix, Vector
from cpbench.verification.equilibration import equilibrate_apart

REACH = 10.0
"""Sizes up to which solutions are excluded of problems near the one asked. Those of 60 of 63 programs by Maros and
Mészáros (1999) are within."""
IDLE = 1e-6
"""Share by which a side counts that 0 meets: a contradiction of 1e-12 of it is one of 1e-6 at most."""


@dataclass(frozen=True, eq=False)
class Sizes:
    """The size of the part of every row (m,) and of every unknown (n,), each in its own unit.

    `reach` (n,) is the |x_j| up to which solutions are excluded: REACH sizes, or what bounds leave when they change.
    """

    rows: Vector
    unknowns: Vector
    reach: Vector

    @classmethod
    def of(cls, rows: Matrix, low: Vector, high: Vector, count: int) -> Sizes:
        """Measure low ≤ (rows·x, x) ≤ high, (m + n,), where sides may be infinite; the first rows (`count`) are
        conditions, the others set sizes alone.

        A part of which all sides are 0 has the size 1, in units of its own.
        """
        A: Any = abs(sp.csr_array(rows))
        m, n = A.shape
        _, part = connected_components(sp.block_array([[None, A], [A.T, None]]) if m else sp.csr_array((n, n)))
        with np.errstate(all="ignore"):  # beside subnormal numbers units are infinite
            D, C = equilibrate_apart(A)
            unit = np.concatenate([D, 1.0 / C])
            met = np.maximum(*(np.where(np.isfinite(side), np.abs(side), 0.0) for side in (low, high)))
            size = np.maximum(np.maximum(low, -high), IDLE * met)
            largest = np.zeros(m + n)
            np.maximum.at(largest, part, size * unit)
            own = np.where(largest > 0.0, largest, 1.0)[part] / unit
        empty = np.concatenate([A.sum(axis=1), A.sum(axis=0)]) == 0.0
        own[empty] = np.delete(size, np.arange(count, m)).max(initial=0.0) or 1.0
        own = np.nan_to_num(own, posinf=1e300)
        ends = np.maximum(np.abs(low[m:]), np.abs(high[m:]))
        return cls(own[:count], own[m:], np.minimum(REACH * own[m:], 2.0 * ends + own[m:]))
