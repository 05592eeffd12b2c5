"""What was solved has another cone, or another law, than what was asked."""

from __future__ import annotations

from dataclasses import replace

from cpbench.verification import Status
from cpbench_lab.diagnosis.case import Cause, FailedTrial, Remedy


def wrong_cone(case: FailedTrial) -> Cause | None:
    """Name the conversion, or the solver, that approximates or drops a term, where its answer misses the problem."""
    failed = case.failed
    if failed.kind.exact or failed.status != Status.APPROXIMATE:
        return None
    changed = f"the solver {case.solver.spec.name}" if not case.solver.spec.kind.exact else f"the route {failed.route}"
    there = f", {failed.target_error:.1e} on its own problem" if failed.target_error == failed.target_error else ""
    remedies = ()
    if case.trial.via:
        remedies = (Remedy(text="the same solver by exact conversions", trial=replace(case.trial, via=())),)
    return Cause(
        kind="wrong cone",
        evidence=f"{changed} solves another law ({failed.kind}): error {failed.error:.1e} on what was asked{there}",
        numbers={"error": failed.error, "target_error": failed.target_error},
        proved=True,
        remedies=remedies,
    )
