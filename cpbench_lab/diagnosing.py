"""Why a solver fails on a problem, as the façade and its command ask it."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench.bench.planning.plan import Limits
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError, UnknownName
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
    from cpbench_lab.diagnosis.attempts import attempt
    from cpbench_lab.diagnosis.deadline import Deadline
    from cpbench_lab.diagnosis.diagnose import diagnose as diagnosed

    deadline = Deadline.after(60.0 * minutes)
    with Apart(limits.threads, limits.memory, deadline, say) as run:
        result = diagnosed(trial, partial(attempt, run=run), say=say, deadline=deadline, foreign=True)
    none = result.failed.status in PROVEN or (result.cause is not None and result.cause.kind in PROVEN)
    if result.complaint is None or none or not provable(trial.problem.node):
        return result
    return replace(result, certificate=f"cpbench certify {address} looks for a proof of the true answer")


def trial_of_row(
    results: Path, problem: str, label: str, *, tolerance: float | None, seconds: float | None
) -> SolverTrial:
    """Return what a row of a results file ran: its problem, solver, options, route, tolerance and limit.

    `problem` is its name or address, `label` that of the solver. `tolerance`, `seconds` : others than the row's.

    Raises UnknownName where no row has this problem and label, CpbenchError where several have, or where the problem's
    file has changed.
    """
    from cpbench import storage
    from cpbench.solvers.base import written
    from cpbench_lab.diagnosis.attempts import SolverTrial

    with Store(results) as store:
        rows = list(store.rows())
    known = [row for row in rows if problem in (row.problem, row.address)]
    if not known:
        raise UnknownName("problem", problem, {row.problem for row in rows})
    named = [row for row in known if row.label == label]
    if not named:
        raise UnknownName(f"label of {problem}", label, {row.label for row in known})
    found = [row for row in named if tolerance is None or row.tolerance == tolerance]
    if len(found) != 1:
        asked = ", ".join(sorted({f"{row.tolerance:g}" for row in named}))
        raise CpbenchError(f"{results}: {label} on {problem}: {len(found)} rows; -t names one ({asked})")
    row = found[0]
    loaded = storage.load(row.address)
    if loaded.fingerprint != row.fingerprint:
        raise CpbenchError(
            f"{row.address}: the file changed since the run: {loaded.fingerprint}, was {row.fingerprint}"
        )
    options = ",".join(f"{name}={written(value)}" for name, value in json.loads(row.options).items())
    direct = row.request == "exact" or row.route in (None, "", "direct")
    return SolverTrial(
        problem=loaded,
        solver=f"{row.solver}[{options}]" if options else row.solver,
        tolerance=row.tolerance,
        seconds=seconds or row.seconds or SECONDS,
        via=() if direct else tuple(str(row.route).split(" > ")),
    )
