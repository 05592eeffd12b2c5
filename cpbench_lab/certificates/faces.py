"""Points within the face of solutions that an active set has where its system is singular, by a linear program."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.optimize import linprog

from cpbench.foundation.matrices import Vector
from cpbench_lab.certificates.active_sets import BASIC, LOWER, UPPER, States, at_bounds
from cpbench_lab.certificates.mixed import Mixed


def interior(P: Mixed, states: States, near: Vector) -> Vector | None:
    """Return a point with these states as far from the bounds and from the wrong signs as it can be, in doubles.

    It is a hint: the exact point is found from it, and checked. None where HiGHS finds none.
    """
    n = P.c.size
    sizes = abs(P.K) @ np.abs(near) + np.abs(P.c)
    unit = 1.0 / np.where(sizes > 0, sizes, 1.0)
    rows: Any = sp.csr_array(sp.diags_array(unit) @ P.K)
    c = P.c * unit
    basic = np.flatnonzero(states == BASIC)
    low, high = np.flatnonzero((states == LOWER) & (P.lo < P.hi)), np.flatnonzero(states == UPPER)
    span = np.maximum(np.abs(near), np.abs(near).max(initial=0.0) * 1e-3)
    left, right = basic[np.isfinite(P.lo[basic])], basic[np.isfinite(P.hi[basic])]
    eye: Any = sp.csr_array(sp.eye_array(n))
    above = sp.vstack([-rows[low], rows[high], -eye[left], eye[right]])
    room = np.concatenate([np.ones(low.size + high.size), span[left], span[right]])
    sides = np.concatenate([c[low], -c[high], -P.lo[left], P.hi[right]])
    fixed = at_bounds(P, states)
    bounds = [(v, v) if v == v else (None, None) for v in fixed.tolist()]
    below: Any = sp.csr_array(sp.hstack([above, room[:, None]]))
    equal: Any = sp.csr_array(sp.hstack([rows[basic], sp.csr_array((basic.size, 1))]))
    if not (np.isfinite(below.data).all() and np.isfinite(equal.data).all() and np.isfinite(sides).all()):
        return None  # an answer of 1e300
    found: Any = linprog(
        np.append(np.zeros(n), -1.0),
        A_ub=below,
        b_ub=sides,
        A_eq=equal,
        b_eq=-c[basic],
        bounds=[*bounds, (0.0, 1.0)],
        method="highs",
        options={"time_limit": 10.0},
    )
    return np.asarray(found.x)[:n] if found.x is not None else None
