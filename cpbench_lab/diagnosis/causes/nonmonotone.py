"""A matrix with a direction of negative curvature."""

from __future__ import annotations

from cpbench.formulations import MLCP
from cpbench_lab.diagnosis.case import Cause, FailedTrial
from cpbench_lab.diagnosis.shifted import principal, shifted


def nonmonotone(case: FailedTrial) -> Cause | None:
    """Look at the least eigenvalue of the symmetric part of the problem's matrix."""
    whole = "[[A, C], [D, B]]" if isinstance(case.problem, MLCP) else ""
    subject = whole or principal(case.problem)
    fact = next((f for f in case.source_facts if f.name == "definiteness" and f.matrix == subject), None)
    if fact is None or fact.value not in ("indefinite", "negative semidefinite", "not positive semidefinite"):
        return None
    return Cause(
        kind="nonmonotone",
        evidence=f"{fact}",
        numbers={"least": fact.number or 0.0},
        without=shifted(case.trial, definite=True),
        change=f"{subject} with its diagonal raised until it is definite",
    )
