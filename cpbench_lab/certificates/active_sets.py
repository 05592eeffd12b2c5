"""Which unknowns of an answer are at a bound: read from its doubles, and mended by a few Newton steps in doubles.

Nothing here is believed: what it gives is where an exact proof begins.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg import lstsq

from cpbench.foundation.factorization import sparse_lu
from cpbench.foundation.matrices import Vector
from cpbench_lab.certificates.mixed import Mixed

LOWER, BASIC, UPPER = -1, 0, 1
States = NDArray[np.int8]
STEPS = 30
TIE = 1e-10
"""Over the sum of its terms, what a row may miss where its unknown is at a bound exactly."""
_DENSE = 400


def candidates(P: Mixed, x: Vector) -> Iterator[tuple[States, Vector]]:
    """Yield active sets with a point near each: that of the answer, that of Newton's method from it."""
    first = states_of(P, x)
    yield first, x
    seen, states, near = {first.tobytes()}, first, x
    for _ in range(STEPS):
        solution = solved(P, states, near)
        if solution is None:
            break
        near, states = solution, states_of(P, solution)
        if states.tobytes() in seen:
            yield states, near
            break
        seen.add(states.tobytes())


def states_of(P: Mixed, x: Vector) -> States:
    """Return whether each unknown is nearer to a bound than its row is to 0, by what they do to sums of rows."""
    f = P.K @ x + P.c
    sizes = abs(P.K) @ np.abs(x) + np.abs(P.c)
    weights = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=sizes > 0)
    weighted: Any = sp.csc_array(sp.diags_array(weights) @ abs(P.K))
    effect = np.asarray(weighted.max(axis=0).toarray()).ravel() if weighted.nnz else np.zeros(x.size)
    # what is at a bound to the last bit was put there, by a method with a basis
    with np.errstate(invalid="ignore"):
        low = (f * weights + TIE * (x == P.lo) > (x - P.lo) * effect) & np.isfinite(P.lo)
        high = (-f * weights + TIE * (x == P.hi) > (P.hi - x) * effect) & np.isfinite(P.hi)
    return np.where((P.lo == P.hi) | low, LOWER, np.where(high, UPPER, BASIC)).astype(np.int8)


def at_bounds(P: Mixed, states: States) -> Vector:
    """Return the bound where an unknown is at one, NaN elsewhere."""
    return np.where(states == LOWER, P.lo, np.where(states == UPPER, P.hi, np.nan))


def solved(P: Mixed, states: States, near: Vector) -> Vector | None:
    """Return the point with these states in doubles, the nearest of many; None where it is not finite."""
    x = at_bounds(P, states)
    basic = np.flatnonzero(states == BASIC)
    x[basic] = 0.0
    right = -(P.K @ x + P.c)[basic]
    block: Any = sp.csc_array(P.K[basic][:, basic])
    if basic.size:
        part = _step(block, right, near[basic])
        if part is None:
            return None
        x[basic] = part
    return x if np.isfinite(x).all() else None


def _step(block: Any, right: Vector, near: Vector) -> Vector | None:
    if right.size <= _DENSE:
        step: Any = lstsq(block.toarray(), right - block @ near, check_finite=False)[0]
        return near + step
    factors = sparse_lu(block)
    if factors is None:
        return None
    part = factors.solve(right)
    return part + factors.solve(right - block @ part)
