"""The problem has no solution."""

from __future__ import annotations

import numpy as np

from cpbench import verification
from cpbench.foundation.plurals import counted
from cpbench.verification.certificates import Infeasible
from cpbench_lab.diagnosis.case import Cause, FailedTrial

SECONDS = 5.0


def infeasible(case: FailedTrial) -> Cause | None:
    """Look for multipliers that contradict the problem's linear conditions, in rational arithmetic (Farkas)."""
    if case.failed.solved:
        return None
    trial = case.trial
    seconds = min(SECONDS, trial.seconds)
    proof = verification.prove(case.problem, Infeasible.kind, seconds=seconds, tolerance=trial.tolerance).proof
    if not isinstance(proof, Infeasible):
        return None
    rows = np.flatnonzero([v != 0 for v in proof.multipliers])
    named = ", ".join(str(i + 1) for i in rows[:6]) + (", …" if rows.size > 6 else "")
    evidence = f"no point meets its linear conditions: {counted(rows.size, 'row')} ({named}) contradict each other"
    return Cause(
        kind="infeasible",
        evidence=f"{evidence}, proved in rational arithmetic",
        numbers={"rows": rows.size},
        proved=True,
    )
