"""The limit of iterations is too small."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import numpy as np

from cpbench.foundation import brackets
from cpbench.foundation.matrices import Vector
from cpbench.solvers.base import Claim
from cpbench.verification import Status
from cpbench_lab.diagnosis.case import Cause, FailedTrial, Remedy

MORE = 100
"""How many times the limit is tried."""


def iterations(case: FailedTrial) -> Cause | None:
    """Read from the residuals how many iterations are missing; ask for a hundred times as many."""
    if case.failed.raw.claim != Claim.MAX_ITER or case.failed.status == Status.TIMEOUT:
        return None
    name, given = brackets.read("solver", case.trial.solver)
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
    raised = {key: str(MORE * value) for key, value in limits.items() if value > 0}
    if not raised:
        return Cause(kind="iterations", evidence=evidence, numbers={"used": used})
    settings = ",".join(f"{key}={value}" for key, value in (dict(given) | raised).items())
    more = replace(case.trial, solver=f"{name}[{settings}]")
    change = f"{MORE} times the limit"
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
