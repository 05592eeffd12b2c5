"""What the iterates show: a cycle, growth without bound."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cpbench.foundation.matrices import Vector
from cpbench_lab.diagnosis.case import Cause, FailedTrial
from cpbench_lab.diagnosis.causes.structure import dominated

SAME = 1e-6
"""Two iterates are the same if they differ by less than this share of the move between neighbours."""
LONGEST = 50
"""The longest period that is looked for."""
GROWN = 1e3
"""By how much the iterates have to grow in the second half of what was kept."""


def cycling(case: FailedTrial) -> Cause | None:
    """Find the least period p ≥ 2 with which iterates repeat while they move, to the end."""
    found = period(case.failed.raw.iterations, case.failed.raw.iterates)
    if found is None:
        return None
    p, moved, last = found
    return Cause(
        kind="cycling",
        evidence=f"its iterates repeat with period {p} up to iteration {last}, and move by {moved:.1e} of their size",
        numbers={"period": p, "moved": moved, "last": last},
        without=dominated(case.trial),
        change="the diagonal of its matrix raised to twice the rest of each row, so that sweeps contract",
    )


def period(iterations: Vector, iterates: NDArray[np.float64]) -> tuple[int, float, int] | None:
    """Return the period, the least move over the size of the iterates, and the last iteration that was seen.

    None where they do not repeat. The period is read from the last run of at least 3p neighbours; what was kept later
    of the iterates, but for the last one, which may be the best, has to be in the cycle.
    """
    if len(iterates) < 6 or not np.isfinite(iterates).all():
        return None
    run = _last_run(iterations)
    X = iterates[run]
    for p in range(2, min(LONGEST, len(X) // 3) + 1):
        cycle = X[-p:]
        move = float(np.abs(np.diff(X[-p - 1 :], axis=0)).max(axis=1).min())
        back = float(np.abs(cycle - X[-2 * p : -p]).max())
        if move > 0 and back <= SAME * move:
            later = iterates[run.stop : -1]
            away = [float(np.abs(cycle - x).max(axis=1).min()) for x in later]
            if max(away, default=0.0) <= SAME * move:
                return p, move / (float(np.abs(cycle).max()) or 1.0), int(iterations[-1])
    return None


def _last_run(iterations: Vector) -> slice:
    """Return where the last run of at least six iterations stands, each the next of the one before."""
    breaks = [0, *(np.flatnonzero(np.diff(iterations) != 1) + 1).tolist(), iterations.size]
    runs = [slice(a, b) for a, b in pairwise(breaks) if b - a >= 6]
    return runs[-1] if runs else slice(0, 0)


def diverging(case: FailedTrial) -> Cause | None:
    """Measure the growth of the iterates, each with the next, over the second half of those that were kept."""
    X = case.failed.raw.iterates
    if len(X) < 6 or case.failed.solved:
        return None
    with np.errstate(all="ignore"):
        sizes = np.abs(X).max(axis=1)
    sizes = sizes[np.isfinite(sizes) & (sizes > 0)]
    top = int(sizes.argmax()) if sizes.size else 0
    half = sizes[top // 2 : top + 1]
    if half.size < 3 or half[-1] / half[0] < GROWN:
        return None
    factor = float((half[-1] / half[0]) ** (1.0 / (half.size - 1)))
    return Cause(
        kind="diverging",
        evidence=f"its iterates grow by a factor of {factor:.3g} each, to {half[-1]:.1e}",
        numbers={"factor": factor, "size": float(half[-1])},
        without=dominated(case.trial),
        change="the diagonal of its matrix raised to twice the rest of each row, so that sweeps contract",
    )
