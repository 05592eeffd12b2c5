"""The time limit is too small."""

from __future__ import annotations

from dataclasses import replace

from cpbench.verification import Status
from cpbench_lab.diagnosis.case import Cause, FailedTrial, Remedy

MORE = 10.0
LONGEST = 60.0
"""Seconds of the longest try."""


def time_limit(case: FailedTrial) -> Cause | None:
    """Ask again with ten times the time, at most a minute."""
    longer = min(MORE * case.trial.seconds, LONGEST)
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
