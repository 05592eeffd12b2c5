"""Exact solutions of polyhedral problems, from an answer in doubles.

The answer's active set makes a square linear system. It is solved over the rationals, and every bound and sign is
checked exactly; where a few are wrong the active set is changed there, as principal pivoting does. A singular system
has its largest regular part solved, with the other unknowns held where the answer has them; where that fails, a vertex
is looked for by the simplex method (`vertices`).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from cpbench.foundation.matrices import Vector
from cpbench_lab.certificates.active_sets import BASIC, LOWER, UPPER, States, candidates, solved
from cpbench_lab.certificates.basic_points import ExactPoint, exact_point, violations
from cpbench_lab.certificates.exact_rows import ExactRows, nearest
from cpbench_lab.certificates.mixed import Mixed
from cpbench_lab.certificates.vertices import at_vertex

ROUNDS, SINGLE = 10, 40
"""Changes of the active set: at all wrong places, then at the first wrong one."""
FEW = 8
"""Unknowns of which all choices of those at their bounds are tried."""


def prove(P: Mixed, x: Vector, seconds: float, *, pivots: bool = True) -> ExactPoint:
    """Look for an exact solution near x, for about so many seconds; without `pivots` at the active sets that doubles
    show alone."""
    deadline = time.perf_counter() + seconds
    K, tried, reason = ExactRows.of(P.K), set[bytes](), "no active set was found"
    if not np.isfinite(P.K @ x + P.c).all():
        return ExactPoint(None, [], "sums of its rows are beyond all doubles")
    known = [(states, near) for states, near in candidates(P, x) if np.isfinite(P.K @ near + P.c).all()]
    # each as it is first: what is nearest to the answer is the better proof, and pivots may go far away
    for changes in (0, ROUNDS + SINGLE) if pivots else (0,):
        for states, near in reversed(known) if changes else known:
            result = _pivoted(P, K, states, near, changes, tried, deadline)
            if result.support is not None:
                return result
            reason = result.reason or reason
    for _, near in known if pivots else ():
        result = at_vertex(P, K, near, deadline)
        if result.support is not None:
            return result
        reason = result.reason or reason
    for states, near in known if pivots else ():
        result = _of_some(P, K, states, near, deadline)
        if result.support is not None:
            return result
    return ExactPoint(None, [], reason)


def _of_some(P: Mixed, K: ExactRows, states: States, near: Vector, deadline: float) -> ExactPoint:
    """Return the exact point where some of a few basic unknowns are at their bounds instead, whichever they are: sides
    that nearly meet in a point are not told apart in doubles."""
    doubtful = np.flatnonzero((states == BASIC) & np.isfinite(np.minimum(np.abs(P.lo), np.abs(P.hi))))
    bounds = np.where(near[doubtful] - P.lo[doubtful] <= P.hi[doubtful] - near[doubtful], LOWER, UPPER)
    if doubtful.size > FEW:
        return ExactPoint(None, [])
    for chosen in product((False, True), repeat=doubtful.size):
        if time.perf_counter() > deadline:
            break
        changed = states.copy()
        changed[doubtful[list(chosen)]] = bounds[list(chosen)]
        result = exact_point(P, K, changed, near, deadline)
        if result.support is not None and not violations(P, K, result.x):
            return result
    return ExactPoint(None, [])


def _pivoted(
    P: Mixed, K: ExactRows, states: States, near: Vector, changes: int, tried: set[bytes], deadline: float
) -> ExactPoint:
    """Return the exact point of an active set, or of one that so many changes lead to."""
    first = ""
    for count in range(changes + 1):
        if count and states.tobytes() in tried:
            return ExactPoint(None, [], first)
        tried.add(states.tobytes())
        if time.perf_counter() > deadline:
            return ExactPoint(None, [], first or "the time is over")
        result = exact_point(P, K, states, near, deadline)
        if result.support is None:
            return ExactPoint(None, [], result.reason)
        wrong = violations(P, K, result.x)
        if not wrong:
            return result
        first = first or _told(P, result.x, wrong)
        changed = wrong if count < ROUNDS else wrong[:1]
        states = states.copy()
        for i, state in changed:
            states[i] = state
        there = solved(P, states, near)
        if there is None:
            return ExactPoint(None, [], first)
        near = there
    return ExactPoint(None, [], first)


def _told(P: Mixed, x: Sequence[Any], wrong: list[tuple[int, int]]) -> str:
    i, state = wrong[0]
    more = f", and {len(wrong) - 1} more" if len(wrong) > 1 else ""
    if state == BASIC:
        return f"row {i} has the wrong sign, or is not 0, at the exact point of the active set{more}"
    return f"unknown {i} is {nearest(x[i]):.3g} there, outside [{P.lo[i]:g}, {P.hi[i]:g}]{more}"
