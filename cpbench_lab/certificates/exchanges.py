"""Exact steps from one active set to the next where the data are degenerate: a row enters, another unknown leaves.

A violated row i asks for its unknown to move away from its bound. The basic unknowns move with it, along exact straight
lines, until the row is 0, or until one of them is at a bound and stays there: the step of a dual active-set method
(Goldfarb and Idnani, Mathematical Programming 27, 1983), in rational arithmetic.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from cpbench.foundation.matrices import Vector
from cpbench_lab.certificates.active_sets import BASIC, LOWER, UPPER, States
from cpbench_lab.certificates.basic_points import ExactPoint, exact_point, row_value, violations
from cpbench_lab.certificates.exact_rows import ExactRows, rational
from cpbench_lab.certificates.mixed import Mixed

COMPLETIONS = 30
"""Steps that make a system regular."""
STEPS = 200
"""Rows that enter, and unknowns that leave for one of them."""


def exchanged(P: Mixed, K: ExactRows, states: States, near: Vector, deadline: float) -> ExactPoint:
    """Walk from an active set to one whose exact point meets all conditions; without a support where that fails."""
    tried = set[bytes]()
    if time.perf_counter() > deadline:
        return ExactPoint(None, [])
    current = _regular(P, K, states, near, deadline)
    while current is not None and current.tobytes() not in tried and len(tried) < STEPS:
        tried.add(current.tobytes())
        result = exact_point(P, K, current, near)
        if result.support is None or time.perf_counter() > deadline:
            break
        wrong = violations(P, K, result.x)
        if not wrong:
            return result
        entering = [i for i, state in wrong if state == BASIC and current[i] != BASIC]
        moved = _entered(P, K, current, near, entering[0], deadline) if entering else None
        if moved is None:
            moved = current.copy()
            for i, state in wrong[:1]:
                moved[i] = state
        current = _regular(P, K, moved, near, deadline)
    return ExactPoint(None, [])


def _regular(P: Mixed, K: ExactRows, states: States, near: Vector, deadline: float) -> States | None:
    """States whose basic system is regular: what is redundant goes to a bound, or is completed where it has none.

    None where that fails.
    """
    for _ in range(COMPLETIONS):
        found = exact_point(P, K, states, near)
        if found.support is None or time.perf_counter() > deadline:
            return None
        redundant = np.flatnonzero((states == BASIC) & ~np.isnan(found.support.held))
        if not redundant.size:
            return states
        states = states.copy()
        bounded = [i for i in redundant.tolist() if np.isfinite(P.lo[i]) or np.isfinite(P.hi[i])]
        for i in bounded:
            states[i] = LOWER if near[i] - P.lo[i] <= P.hi[i] - near[i] else UPPER
        entering = None if bounded else _completion(P, states, near)
        if entering is not None:
            states[entering] = BASIC
        elif not bounded:
            return None
    return None


def _completion(P: Mixed, states: States, near: Vector) -> int | None:
    """Return the unknown at a bound that makes a singular system less so, by the least ratio of its row: a hint."""
    basic = np.flatnonzero(states == BASIC)
    others = np.flatnonzero((states != BASIC) & (P.lo < P.hi))
    left: Any = np.linalg.svd(P.K[basic][:, basic].toarray())[0][:, -1]
    reach = np.abs(left @ P.K[basic][:, others].toarray())
    possible = reach > 1e-9 * reach.max(initial=0.0)
    if not possible.any():
        return None
    rows = np.abs(P.K @ near + P.c)[others]
    ratio = np.where(possible, rows / np.where(possible, reach, 1.0), np.inf)
    return int(others[np.argmin(ratio)])


def _entered(P: Mixed, K: ExactRows, states: States, near: Vector, i: int, deadline: float) -> States | None:
    """Return the states after row i has become 0; None where nothing stops its unknown, or a system is singular."""
    states, sign = states.copy(), 1 if states[i] == LOWER else -1
    bound, t = rational(float(P.lo[i] if sign > 0 else P.hi[i])), rational(0.0)
    for _ in range(STEPS):
        here = exact_point(P, K, states, near, {i: bound + sign * t})
        there = exact_point(P, K, states, near, {i: bound + sign * (t + 1)})
        basic = np.flatnonzero(states == BASIC)
        if here.support is None or there.support is None or here.support.rows.size < basic.size:
            return None
        f = row_value(P, K, i, here.x)
        slope = row_value(P, K, i, there.x) - f
        whole = -f / slope if slope * sign > 0 else None
        step, j, state = _first(P, basic.tolist(), here.x, there.x)
        if whole is not None and (step is None or whole <= step):
            states[i] = BASIC
            return states
        if step is None or time.perf_counter() > deadline:
            return None
        states[j] = state
        t += step
    return None


def _first(P: Mixed, basic: list[int], here: Any, there: Any) -> tuple[Any, int, int]:
    """Return the first basic unknown that reaches a bound on the way, with the step and the bound."""
    best: tuple[Any, int, int] = (None, -1, BASIC)
    for j in basic:
        slope = there[j] - here[j]
        limit, state = (P.lo[j], LOWER) if slope < 0 else (P.hi[j], UPPER)
        if slope == 0 or np.isinf(limit):
            continue
        step = (rational(float(limit)) - here[j]) / slope
        if step >= 0 and (best[0] is None or step < best[0]):
            best = (step, j, state)
    return best
