"""The solver, or every exact route to it, refuses the problem; or the solver says no more than its message."""

from __future__ import annotations

from cpbench.verification import Status
from cpbench_lab.diagnosis.case import Cause, FailedTrial


def refused(case: FailedTrial) -> Cause | None:
    """Repeat the obstacle that was named."""
    if case.failed.status not in (Status.UNSUPPORTED, Status.UNAVAILABLE):
        return None
    return Cause(kind=str(case.failed.status), evidence=case.failed.message, proved=True)
