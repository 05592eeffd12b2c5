"""What the solver was not allowed, and where it began: too few iterations, too little time, a start without values."""

from __future__ import annotations

import dataclasses
from dataclasses import replace
from typing import Any

import numpy as np

from cpbench.foundation.matrices import Vector
from cpbench.foundation.text import read_brackets
from cpbench.solvers.base import Claim
from cpbench.verification import Status
from cpbench_lab.diagnosis.case import Cause, FailedTrial, Remedy

TIMES = 100
"""How many times the limit is tried."""
LONGER = 10.0
LONGEST = 60.0
"""Seconds of the longest try."""
TRIED = (1.0, 0.1, 10.0)
"""Distances of other starts from the first one."""


def iterations(case: FailedTrial) -> Cause | None:
    """Read from the residuals how many iterations are missing; ask for a hundred times as many."""
    if case.failed.raw.claim != Claim.MAX_ITER or case.failed.status == Status.TIMEOUT:
        return None
    name, given = read_brackets("solver", case.trial.solver)
    options = case.trial.named[1]
    limits = {
        field.name: getattr(options, field.name)
        for field in dataclasses.fields(options)
        if field.name.startswith("max_") and isinstance(getattr(options, field.name), int)
    }
    used = case.failed.raw.counters.get("iterations", max(limits.values(), default=0))
    evidence = f"the limit of {used} iterations was reached at error {case.failed.error:.1e}"
    needed = _needed(case.failed.raw.residuals, case.trial.tolerance)
    if needed:
        evidence += f"; at the rate of its last residuals about {needed} are needed"
    raised = {key: str(TIMES * value) for key, value in limits.items() if value > 0}
    if not raised:
        return Cause(kind="iterations", evidence=evidence, numbers={"used": used})
    settings = ",".join(f"{key}={value}" for key, value in (dict(given) | raised).items())
    more = replace(case.trial, solver=f"{name}[{settings}]")
    change = f"{TIMES} times the limit"
    return Cause(
        kind="iterations",
        evidence=evidence,
        numbers={"used": used, "needed": needed},
        without=more,
        change=change,
        remedies=(Remedy(text=f"{more.solver}: {change}", trial=more),),
    )


def _needed(residuals: Vector, tolerance: float) -> int:
    """Return the iterations until the residual is the tolerance, by the rate of the second half; 0 where it does not
    fall."""
    found = residuals[np.isfinite(residuals) & (residuals > 0)]
    if found.size < 3:
        return 0
    half = found[found.size // 2 :] if found.size > 5 else found
    rate = np.log(half[-1] / half[0]) / (half.size - 1)
    return int(np.ceil(found.size + np.log(tolerance / half[-1]) / rate)) if rate < 0 else 0


def time_limit(case: FailedTrial) -> Cause | None:
    """Ask again with ten times the time, at most a minute."""
    longer = min(LONGER * case.trial.seconds, LONGEST)
    if case.failed.status != Status.TIMEOUT or longer <= case.trial.seconds:
        return None
    counted = case.failed.raw.counters.get("iterations")
    reached = f" after {counted} iterations" if counted else ""
    trial = replace(case.trial, seconds=longer)
    return Cause(
        kind="time",
        evidence=f"the limit of {case.trial.seconds:g} s ended it{reached} at error {case.failed.error:.1e}",
        numbers={"seconds": case.trial.seconds},
        without=trial,
        change=f"{longer:g} s",
        remedies=(Remedy(text=f"the same solver, {longer:g} s", trial=trial),),
    )


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
