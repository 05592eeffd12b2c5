"""The conversion back loses the accuracy that the solver had."""

from __future__ import annotations

import math
from dataclasses import replace

from cpbench.verification import Status
from cpbench_lab.diagnosis.case import Cause, FailedTrial, Remedy

FINEST = 1e-15
"""The tightest tolerance that is asked for."""


def lost(case: FailedTrial) -> Cause | None:
    """Compare the error on the solver's own problem with that of the lifted answer."""
    failed = case.failed
    if failed.status != Status.LOST:
        return None
    factor = failed.error / failed.target_error if failed.target_error > 0 else math.inf
    tighter = max(FINEST, case.trial.tolerance / (10.0 * factor)) if math.isfinite(factor) else FINEST
    evidence = f"{failed.error:.1e} on the problem that was asked, {failed.target_error:.1e} on the solver's own"
    return Cause(
        kind="lost",
        evidence=f"the way back by {failed.route} loses the accuracy: {evidence}",
        numbers={"factor": factor},
        proved=True,
        remedies=(
            Remedy(
                text=f"the same solver, asked for {tighter:.0e} and measured at {case.trial.tolerance:.0e}",
                trial=replace(case.trial, tolerance=tighter),
                back=lambda answer: answer,
            ),
        ),
    )
