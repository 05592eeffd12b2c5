"""The map has no value, or no derivative, where the solver begins."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from cpbench.foundation.matrices import Vector
from cpbench_lab.diagnosis.case import Cause, FailedTrial, Remedy

TRIED = (1.0, 0.1, 10.0)
"""Distances of other starts from the first one."""


def start(case: FailedTrial) -> Cause | None:
    """Evaluate F and its Jacobian at the problem's start; look for one nearby where both are finite."""
    P: Any = case.problem
    if getattr(P, "F", None) is None or not isinstance(getattr(P, "start", None), np.ndarray):
        return None
    begin = P.start if case.trial.start is None else case.trial.start.z
    values, slopes = _at(P.F, begin)
    rows = np.flatnonzero(~(np.isfinite(values) & np.isfinite(slopes)))
    if not rows.size:
        return None
    what = "value" if not np.isfinite(values).all() else "derivative"
    row, at = int(rows[0]), float(begin[rows[0]])
    evidence = f"row {row + 1} of F has no finite {what} at the start (z_{row + 1} = {at:g}), {rows.size} in all"
    fields: dict[str, Any] = {"kind": "start", "evidence": evidence, "numbers": {"rows": rows.size}}
    for away in TRIED:
        point = _moved(P, begin, away)
        if all(np.isfinite(part).all() for part in _at(P.F, point)):
            other = replace(P, start=point) if case.trial.start is None else P
            begun = case.trial.start if case.trial.start is None else type(case.trial.start)(z=point)
            trial = replace(case.trial, problem=other, start=begun)
            change = f"a start {away:g} away from that one"
            remedy = Remedy(text=f"the same solver from {change}", trial=trial, back=lambda answer: answer)
            return Cause(**fields, without=trial, change=change, remedies=(remedy,))
    return Cause(**fields)


def _at(F: Any, z: Vector) -> tuple[Vector, Vector]:
    """Return F(z) and the largest derivative of each row."""
    with np.errstate(all="ignore"):
        values, jacobian = np.asarray(F(z)), F.jacobian(z).toarray()
    return values, np.abs(jacobian).max(axis=1, initial=0.0)


def _moved(P: Any, z: Vector, away: float) -> Vector:
    """Return z moved into its bounds."""
    lb, ub = getattr(P, "lb", np.zeros(z.size)), getattr(P, "ub", np.full(z.size, np.inf))
    return np.clip(z + away, lb, ub)
