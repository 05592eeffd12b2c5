"""The tolerance is below what rounding leaves of the terms of the problem."""

from __future__ import annotations

import math
from dataclasses import replace

from cpbench_lab.diagnosis.attempts import floor_of
from cpbench_lab.diagnosis.case import Cause, FailedTrial, Remedy

ABOVE = 10.0
"""How far above the floor a tolerance is that can be met."""


def rounding(case: FailedTrial) -> Cause | None:
    """Compare the tolerance with the rounding floor of the measured error, at the answer or at a known one."""
    if case.failed.solved:
        return None
    floor = case.failed.floor or floor_of(case.problem, case.known)
    if floor < case.trial.tolerance:
        return None
    reachable = 10.0 ** math.ceil(math.log10(ABOVE * floor))
    looser = replace(case.trial, tolerance=reachable)
    return Cause(
        kind="rounding",
        evidence=f"asked for {case.trial.tolerance:.1e}; rounding of the problem's terms alone leaves {floor:.1e}",
        numbers={"floor": floor},
        proved=True,
        remedies=(Remedy(text=f"the same solver, asked for {reachable:.0e}", trial=looser),),
    )
