"""Pairs of which both are zero at the solution: strict complementarity fails."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from cpbench.foundation import matrices
from cpbench.foundation.plurals import counted
from cpbench_lab.diagnosis.case import Cause, FailedTrial

ROUNDING = 1e-12
"""Share of the terms of a row that its sum is taken to be accurate to."""


def degenerate(case: FailedTrial) -> Cause | None:
    """Count the pairs of a known answer that are both zero, to the square root of the tolerance."""
    P: Any = case.problem
    if P.node not in ("lcp", "ncp", "mlcp") or case.known is None:
        return None
    z = case.known.v if P.node == "mlcp" else case.known.z
    w = P.slacks(case.known)["w"]
    near = np.sqrt(case.trial.tolerance)
    constants = {"lcp": "q", "mlcp": "b"}.get(P.node)
    z_size = matrices.max_abs(z) or 1.0
    w_size, terms = matrices.max_abs(w), matrices.max_abs(getattr(P, constants)) if constants else 0.0
    # where all w are small, their sums of terms are 0 to rounding
    both = (np.abs(z) <= near * z_size) & (np.abs(w) <= max(near * w_size, ROUNDING * terms))
    if not both.any():
        return None
    first = int(np.flatnonzero(both)[0]) + 1
    without = None
    if constants:
        moved = replace(P, **{constants: getattr(P, constants) + np.where(both, max(w_size, terms) or 1.0, 0.0)})
        without = replace(case.trial, problem=moved)
    return Cause(
        kind="degenerate",
        evidence=f"{counted(int(both.sum()), 'pair')} of {both.size} are both zero at a verified answer, first {first}",
        numbers={"pairs": int(both.sum())},
        without=without,
        change="these rows raised, so that every pair is strict",
    )
