"""Units that lie far apart."""

from __future__ import annotations

from dataclasses import replace

from cpbench_lab.diagnosis.case import Cause, FailedTrial, Remedy
from cpbench_lab.diagnosis.scaled import scaled

DECADES = 3.0
"""Decades by which units have to shrink the spread of the rows for a trial to be worth it."""
TIGHTER = 0.1
"""Share of the tolerance that is asked for in other units: what counts is measured in those of the problem."""


def scale(case: FailedTrial) -> Cause | None:
    """Compare the sizes of the rows with those in units, powers of two, in which the entries are alike."""
    found = scaled(case.problem)
    if found is None or found.before - found.after < DECADES:
        return None
    trial = replace(case.trial, problem=found.problem, tolerance=TIGHTER * case.trial.tolerance)
    change = "units in which the entries are alike"
    return Cause(
        kind="scale",
        evidence=f"its rows lie {found.before:.1f} decades apart, {found.after:.1f} in {change}",
        numbers={"before": found.before, "after": found.after},
        without=trial,
        change=change,
        remedies=(Remedy(text=f"the same solver in {change}", trial=trial, back=found.back),),
    )
