"""Failures to be reduced, from a problem or from a row of a results file, and their reduction into a folder."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cpbench.api.problems import load
from cpbench.bench.planning import plan
from cpbench.bench.planning.places import located
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError, UnknownName
from cpbench.generators.collection import address_text, builtin_folder
from cpbench_lab.reduction.folder import write_folder
from cpbench_lab.reduction.predicate import Predicate, parse_predicate, predicate_of
from cpbench_lab.reduction.reduce import Progress, ReducedFailure, reduce
from cpbench_lab.reduction.trials import Asked, Trials


@dataclass(frozen=True)
class FailingCase:
    """A problem and how a solver fails on it."""

    address: str
    asked: Asked


def case_of(
    address: str,
    solver: str,
    predicate: Predicate,
    limits: plan.Limits,
    *,
    tolerance: float = 1e-6,
    via: Sequence[str] = (),
) -> FailingCase:
    """Return the case of a problem; raises UnknownName on a solver."""
    for name in filter(None, (solver, predicate.other)):
        plan.parse_entry(name)
    return FailingCase(located(address, builtin_folder), Asked(solver, predicate, tolerance, limits, tuple(via)))


def case_of_row(results: Path, problem: str, label: str, failure: str | None, limits: plan.Limits) -> FailingCase:
    """Return the case of a row of a results file: its solver with its options and its tolerance.

    Parameters
    ----------
    problem : its name or address. label : the solver's name, or its label. failure : what has to stay, None for the
    row's own status.

    Raises UnknownName where there is no such row, CpbenchError where its status is not a failure.
    """
    with Store(results) as store:
        every = list(store.rows())
    rows = [row for row in every if problem in (row.problem, row.address, address_text(row.address))]
    if not rows:
        raise UnknownName("problem of the results", problem, sorted({row.problem for row in every}))
    found = [row for row in rows if label in (row.label, row.solver)]
    if not found:
        raise UnknownName(f"solver of {problem}", label, sorted({row.label for row in rows}))
    row = found[0]
    entry = plan.Entry(row.solver, json.loads(row.options))
    predicate = parse_predicate(failure) if failure else predicate_of(row.status)
    routes = "exact" if row.request == "exact" else "all"
    return FailingCase(row.address, Asked(entry.label, predicate, row.tolerance, limits, routes=routes))


def reduce_case(
    case: FailingCase, folder: Path, seconds: float, progress: Progress = lambda problem, tried: None
) -> tuple[ReducedFailure, tuple[Path, ...]]:
    """Reduce a case for so many seconds into a new or empty folder.

    Raises NoFailure, NoRoute; CpbenchError where the folder has something in it.
    """
    if folder.exists() and any(folder.iterdir()):
        raise CpbenchError(f"{folder}: is not empty; name a new folder")
    problem = load(case.address)
    with Trials(case.asked, time.monotonic() + seconds) as trials:
        reduced = reduce(problem, trials, progress)
    return reduced, write_folder(reduced, case.asked, address_text(case.address), folder)
