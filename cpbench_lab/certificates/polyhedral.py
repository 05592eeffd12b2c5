"""Exact solutions of polyhedral problems, from an answer in doubles.

The answer's active set makes a square linear system. It is solved over the rationals, and every bound and sign is
checked exactly; where a few are wrong the active set is changed there, as principal pivoting does. A singular system
has its largest regular part solved, with the other unknowns held where the answer has them; where that fails, a vertex
is looked for by the simplex method (`vertices`).
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import sys
import time
from collections.abc import Generator, Sequence
from itertools import product
from typing import Any

import numpy as np
import scipy.sparse as sp

from cpbench.foundation.matrices import Vector
from cpbench_lab.certificates.active_sets import BASIC, LOWER, UPPER, States, at_bounds, candidates, solved
from cpbench_lab.certificates.basic_points import ExactPoint, exact_point, row_value, system_point, violations
from cpbench_lab.certificates.exact_rows import ExactRows, Index, nearest
from cpbench_lab.certificates.mixed import Mixed

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


# ------------------------------------------------------------------------------------------------------------- vertices
# A vertex of the solutions that an active set allows, by the simplex method: a regular system where the active set's
# own one is singular.
#
# An unknown at a bound stays there, and its row may have any value of the right sign; an unknown between its bounds has
# a row that is 0. Of a pair in which both are small, either may be away from 0, at a cost. These conditions make a
# polyhedron. At a vertex of it, as many rows are 0 as unknowns are between
# their bounds; the basis of the simplex method says which, and that system is solved over the rationals. HiGHS is a
# hint: what it gives is checked exactly.

ROUNDS = 6
"""Vertices that are tried."""
UNSURE = 2
SMALL = (1e-6, 1e-4, 1e-8)
"""Shares of their sizes below which an unknown's distance from its bound and its row tell nothing about the pair."""
ACCURACY = 1e-10
"""HiGHS' least feasibility tolerance."""


@contextlib.contextmanager
def _nothing_printed() -> Generator[None]:
    """Send what compiled code prints on standard output to nowhere."""
    sys.stdout.flush()
    kept = os.dup(1)
    try:
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def at_vertex(P: Mixed, K: ExactRows, near: Vector, deadline: float) -> ExactPoint:
    """Return the exact point of a vertex near `near` that meets all conditions; without a support where none is found.

    Rows that depend on others to rounding are not 0 together at any exact point: one that is on the right side of 0
    gets its unknown back to the bound, and the others are tried again.
    """
    if importlib.util.find_spec("highspy") is None:
        return ExactPoint(None, [])
    reason = ""
    for small in SMALL:
        result = _mended(P, K, _states(P, near, small), near, deadline)
        if result.support is not None:
            return result
        reason = reason or result.reason
    return ExactPoint(None, [], reason)


def _mended(P: Mixed, K: ExactRows, states: States, near: Vector, deadline: float) -> ExactPoint:
    """Return the exact point of a vertex, after rows that depend on others were let go."""
    for _ in range(ROUNDS):
        result = _vertex(P, K, states, near, deadline)
        wrong = violations(P, K, result.x) if result.support is not None else []
        if not wrong:
            return result
        loose = 0
        for i, state in wrong:
            side = row_value(P, K, i, result.x) if state == BASIC and states[i] == BASIC else 0
            back = LOWER if side > 0 and np.isfinite(P.lo[i]) else UPPER if side < 0 and np.isfinite(P.hi[i]) else BASIC
            if back != BASIC:
                states[i], loose = back, loose + 1
        if not loose:
            i, state = wrong[0]
            if state == BASIC and states[i] == BASIC and P.lo[i] == -np.inf and P.hi[i] == np.inf:
                return ExactPoint(
                    None, [], f"row {i} is 0 to rounding, and depends on others with which it is not 0 exactly"
                )
            return ExactPoint(None, [])
    return ExactPoint(None, [])


def _vertex(P: Mixed, K: ExactRows, states: States, near: Vector, deadline: float) -> ExactPoint:
    """Return the exact point of a vertex that the simplex method finds; without a support where it finds none."""
    found = _basis(P, states, near, deadline - time.perf_counter())
    if found is None:
        return ExactPoint(None, [])
    held, rows, columns = found
    return system_point(P, K, held, rows, columns, deadline)


def _basis(P: Mixed, states: States, near: Vector, seconds: float) -> tuple[Vector, Index, Index] | None:
    """Return what unknowns are held at, NaN where they are basic; the rows that are 0; and the basic unknowns."""
    import highspy

    if seconds <= 0.0:  # to HiGHS no limit at all
        return None
    unit, span = _units(P, near)
    unsure = (np.abs(states) == UNSURE) & (P.lo < P.hi)
    states = np.clip(states, LOWER, UPPER)
    held = np.where(unsure, np.nan, at_bounds(P, states))
    free, used = np.flatnonzero(np.isnan(held)), np.flatnonzero(P.lo < P.hi)
    level = -((P.K @ np.where(np.isnan(held), 0.0, held) + P.c) * unit)[used]
    rows: Any = sp.csc_array(sp.diags_array(unit[used]) @ P.K[used][:, free] @ sp.diags_array(span[free]))
    if not (np.isfinite(rows.data).all() and np.isfinite(level).all()):
        return None  # an answer of 1e300
    sign = np.where(states == UPPER, -1.0, 1.0) * unsure
    cost = sign[free] + rows.T @ sign[used]
    span = span[free]
    lp = highspy.HighsLp()
    lp.num_col_, lp.num_row_ = free.size, used.size
    lp.col_cost_ = cost
    lp.col_lower_, lp.col_upper_ = P.lo[free] / span, P.hi[free] / span
    lp.row_lower_ = np.where(states[used] == UPPER, -np.inf, level)
    lp.row_upper_ = np.where(states[used] == LOWER, np.inf, level)
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.start_, lp.a_matrix_.index_, lp.a_matrix_.value_ = rows.indptr, rows.indices, rows.data
    with _nothing_printed():  # HiGHS 1.16 prints its banner when an object is made
        model = highspy.Highs()
    for name, value in {
        "output_flag": False, "solver": "simplex", "time_limit": seconds, "primal_feasibility_tolerance": ACCURACY,
        "threads": 1,
    }.items():  # fmt: skip
        model.setOptionValue(name, value)
    model.passModel(lp)
    model.run()
    if model.getModelStatus() != highspy.HighsModelStatus.kOptimal:
        return None
    basis = model.getBasis()
    of_columns, of_rows = list(basis.col_status), list(basis.row_status)
    status = highspy.HighsBasisStatus
    for j, state in zip(free.tolist(), of_columns, strict=True):
        if state != status.kBasic:
            held[j] = {status.kLower: P.lo[j], status.kUpper: P.hi[j]}.get(state, 0.0)
    basic = free[[state == status.kBasic for state in of_columns]]
    zero = used[[state != status.kBasic for state in of_rows]]
    return (held, zero, basic) if zero.size == basic.size else None


def _states(P: Mixed, near: Vector, small: float) -> States:
    """Return the states of a point, twice the nearer bound where the pair is unsure."""
    unit, span = _units(P, near)
    left, right, row = (near - P.lo) / span, (P.hi - near) / span, np.abs(P.K @ near + P.c) * unit
    gap, bound = np.minimum(left, right), np.where(left <= right, LOWER, UPPER)
    states = np.where((gap < row) | (P.lo == P.hi), bound, BASIC)
    return np.where((row <= small) & (gap <= small) & (P.lo < P.hi), UNSURE * bound, states).astype(np.int8)


def _units(P: Mixed, near: Vector) -> tuple[Vector, Vector]:
    """Return powers of two near 1/size of the rows and near the size of the unknowns.

    Sizes are those of the largest among the unknowns that are compared, and among the others: what is small beside them
    is the noise of the answer.
    """
    n, sizes = P.answer.shape[0], abs(P.K) @ np.abs(near) + np.abs(P.c)
    unit, span = np.ones(near.size), np.ones(near.size)
    for part in (slice(0, n), slice(n, None)):
        tops = sizes[part].max(initial=0.0), np.abs(near[part]).max(initial=0.0)
        unit[part], span[part] = (float(np.exp2(np.rint(np.log2(top)))) if top > 0 else 1.0 for top in tops)
    return 1.0 / unit, span
