"""The objective has no lower bound."""

from __future__ import annotations

import numpy as np

from cpbench import verification
from cpbench.foundation.plurals import counted
from cpbench.verification.certificates import Unbounded
from cpbench_lab.diagnosis.case import Cause, FailedTrial

SECONDS = 5.0


def unbounded(case: FailedTrial) -> Cause | None:
    """Look for a feasible point and a ray along which the objective falls for ever, in rational arithmetic."""
    if case.failed.solved:
        return None
    trial = case.trial
    seconds = min(SECONDS, trial.seconds)
    proof = verification.prove(case.problem, Unbounded.kind, seconds=seconds, tolerance=trial.tolerance).proof
    if not isinstance(proof, Unbounded):
        return None
    moving = int(np.count_nonzero([v != 0 for v in proof.ray]))
    evidence = f"from a feasible point the objective falls for ever along a ray of {counted(moving, 'unknown')}"
    return Cause(
        kind="unbounded",
        evidence=f"{evidence}, proved in rational arithmetic",
        numbers={"unknowns": moving},
        proved=True,
    )
