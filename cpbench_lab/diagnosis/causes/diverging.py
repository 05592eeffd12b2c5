"""Iterates that grow without bound."""

from __future__ import annotations

import numpy as np

from cpbench_lab.diagnosis.case import Cause, FailedTrial
from cpbench_lab.diagnosis.shifted import dominated

GROWN = 1e3
"""By how much the iterates have to grow in the second half of what was kept."""


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
