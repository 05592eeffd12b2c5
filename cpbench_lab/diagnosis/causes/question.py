"""What the problem or the question excludes, and what is said of it: no solution, no lower bound, a tolerance below
rounding, another law, digits lost on the way back, a refusal."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np

from cpbench import proofs
from cpbench.foundation.text import counted
from cpbench.proofs.certificates import Infeasible, Unbounded
from cpbench.verification import Status
from cpbench_lab.diagnosis.attempts import floor_of
from cpbench_lab.diagnosis.case import Cause, FailedTrial, Remedy

Proof = TypeVar("Proof", Infeasible, Unbounded)

SECONDS = 5.0
FINEST = 1e-15
"""The tightest tolerance that is asked for."""


def _proof(case: FailedTrial, kind: type[Proof]) -> Proof | None:
    """Return the proof of this kind that a problem has no solution, where no answer is right and there is one."""
    if case.failed.solved:
        return None
    seconds = min(SECONDS, case.trial.seconds)
    proof = proofs.prove(case.problem, kind.kind, seconds=seconds, tolerance=case.trial.tolerance).proof
    return proof if isinstance(proof, kind) else None


def infeasible(case: FailedTrial) -> Cause | None:
    """Look for multipliers that contradict the problem's linear conditions (Farkas)."""
    proof = _proof(case, Infeasible)
    if proof is None:
        return None
    rows = np.flatnonzero([v != 0 for v in proof.multipliers])
    named = ", ".join(str(i + 1) for i in rows[:6]) + (", …" if rows.size > 6 else "")
    evidence = f"no point meets its linear conditions: {counted(rows.size, 'row')} ({named}) contradict each other"
    return Cause(
        kind="infeasible",
        evidence=f"{evidence}, by a margin that rounding does not reach",
        numbers={"rows": rows.size},
        proved=True,
    )


def unbounded(case: FailedTrial) -> Cause | None:
    """Look for a feasible point and a ray along which the objective falls for ever."""
    proof = _proof(case, Unbounded)
    if proof is None:
        return None
    moving = int(np.count_nonzero([v != 0 for v in proof.ray]))
    evidence = f"from a feasible point the objective falls for ever along a ray of {counted(moving, 'unknown')}"
    return Cause(
        kind="unbounded",
        evidence=f"{evidence}, by a margin that rounding does not reach",
        numbers={"unknowns": moving},
        proved=True,
    )


def rounding(case: FailedTrial) -> Cause | None:
    """Compare the tolerance with the rounding floor of the measured error, at the answer or at a known one."""
    if case.failed.solved:
        return None
    floor = case.failed.floor or floor_of(case.problem, case.known)
    if floor < case.trial.tolerance:
        return None
    return Cause(
        kind="rounding",
        evidence=f"asked for {case.trial.tolerance:.1e}; rounding of the problem's terms alone leaves {floor:.1e}",
        numbers={"floor": floor},
        proved=True,
    )


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


def refused(case: FailedTrial) -> Cause | None:
    """Repeat the obstacle that was named."""
    if case.failed.status not in (Status.UNSUPPORTED, Status.UNAVAILABLE):
        return None
    return Cause(kind=str(case.failed.status), evidence=case.failed.message, proved=True)
