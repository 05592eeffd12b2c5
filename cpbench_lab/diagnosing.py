"""Why a solver fails on a problem, as the façade and its command ask it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from cpbench.bench.planning.plan import Limits
from cpbench.formulations.base import Problem
from cpbench.verification import PROVEN

if TYPE_CHECKING:
    from cpbench_lab.diagnosis.attempts import SolverTrial
    from cpbench_lab.diagnosis.diagnosis import Diagnosis

SECONDS = 10.0
"""Limit of a solve [s], where none is given."""
MINUTES = 2.0
"""Time of a whole explanation by the command."""


def diagnose(
    problem: Problem,
    solver: str,
    *,
    tolerance: float = 1e-6,
    seconds: float = SECONDS,
    via: Sequence[str] = (),
    start: Any = None,
) -> Diagnosis:
    """Say why a solver fails: the first confirmed cause and the remedies that were tried, in this process.

    Parameters
    ----------
    solver : a name, with options where wanted: ``"nsgs[omega=1.2]"``. tolerance, seconds : as for `solve`; every try
        has as much time. via : conversions to take. start : a point of the problem where the solver begins.

    Returns
    -------
    Diagnosis : its `cause` is proved, or the same solver succeeds without it; None where there is no such cause, and
        where the solver does not fail. `suspected` are properties that were not confirmed.

    Raises UnknownName.

    >>> import cpbench
    >>> lcp = cpbench.LCP(M=[[1.0, 1.0], [-1.0, 1.0]], q=[-3.0, -1.0])
    >>> found = cpbench.diagnose(lcp, "pgs")
    >>> found.cause.kind, found.cause.numbers["period"], found.remedy.remedy.text
    ('cycling', 2, 'auto-lcp (automatic choice)')
    """
    from cpbench_lab.diagnosis.attempts import SolverTrial
    from cpbench_lab.diagnosis.diagnose import diagnose as diagnosed

    trial = SolverTrial(
        problem=problem, solver=solver, tolerance=tolerance, seconds=seconds, via=tuple(via), start=start
    )
    return diagnosed(trial)


def diagnose_apart(
    trial: SolverTrial, limits: Limits, *, minutes: float, say: Callable[[str], None], address: str
) -> Diagnosis:
    """Do the same with every solve in another process, which is stopped at the limits; solvers by others are remedies.

    `minutes` : time of it all; what is found by then is returned. `say` : takes a line on what is being tried.
    `address` : of the problem, for the command that certifies it.
    """
    from cpbench_lab.certificates.mixed import provable
    from cpbench_lab.diagnosis.apart import Apart
    from cpbench_lab.diagnosis.attempts import Deadline, attempt
    from cpbench_lab.diagnosis.diagnose import diagnose as diagnosed

    deadline = Deadline.after(60.0 * minutes)
    with Apart(limits.threads, limits.memory, deadline, say) as run:
        result = diagnosed(trial, partial(attempt, run=run), say=say, deadline=deadline, foreign=True)
    none = result.failed.status in PROVEN or (result.cause is not None and result.cause.kind in PROVEN)
    if result.complaint is None or none or not provable(trial.problem.node):
        return result
    return replace(result, certificate=f"cpbench certify {address} looks for a proof of the true answer")
