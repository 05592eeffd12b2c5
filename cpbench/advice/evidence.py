"""What `cpbench recommend` goes by: the shipped table, results files, tables that were made of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from cpbench.advice.candidates import solver_of
from cpbench.analysis import table as rows_of
from cpbench.analysis.training_cases import TrainingCases, collect_cases, from_text, shipped_cases
from cpbench.bench.results.problem_features import problem_features
from cpbench.bench.results.sealed import sealed
from cpbench.bench.results.store import Store
from cpbench.errors import CpbenchError
from cpbench.plurals import counted


def gather(
    results: Sequence[Path], warm: bool, inexact: bool, tolerance: float | None = None
) -> tuple[TrainingCases, str, list[str]]:
    """Return the training cases, their source in words, and remarks for the reader.

    Without `results` they are those of the table that cpbench ships. Raises CpbenchError where nobody solved anything.
    """
    if results:
        known, remarks = read(results, warm, inexact, tolerance)
        source = ", ".join(map(str, results))
    else:
        _require_none(tolerance, "the built-in problems")
        known, source, remarks = shipped_cases(), "the built-in problems", []
        if warm:
            known = replace(known, cases=())
    if warm and not known.cases:
        cold, source, remarks = gather(results, False, inexact, tolerance)
        return cold, source, ["no warm start was measured: ranked by cold ones, of solvers that take a start", *remarks]
    if known.unfinished:
        remarks.append(f"left out, for some of their pairs were not run: {counted(known.unfinished, 'problem')}")
    if not known.cases:
        lost = f"nobody solved any of its {known.unsolved} problems" if known.unsolved else "it has no finished problem"
        raise CpbenchError(f"{source}: nothing to learn from: {lost}; leave --results out for the shipped table")
    if len(known.labels) == 1:
        remarks.append(f"only {known.labels[0]} was measured: it is the best of one")
    return known, source, remarks


def read(
    results: Sequence[Path], warm: bool, inexact: bool, tolerance: float | None = None
) -> tuple[TrainingCases, list[str]]:
    """Return the training cases of results files and tables together; rows of the same machine are compared across
    files.

    `tolerance` : of the rows to go by, None for all. Raises CpbenchError where no row has it, and for tables.
    """
    rows: list[pd.DataFrame] = []
    features: dict[str, dict[str, Any]] = {}
    known, lost = TrainingCases(()), 0
    for path in results:
        if path.suffix == ".json" and path.is_file():
            _require_none(tolerance, str(path))
            read = from_text(path.read_text(encoding="utf-8", errors="replace"), str(path))
            if not warm:
                known = replace(known, cases=(*known.cases, *read.cases), unsolved=known.unsolved + read.unsolved)
            continue
        with sealed(path) as store:
            rows.append(_at(store.table(), tolerance, path))
            found, without = problem_features(store)
        features |= {key: facts for key, facts in found.items() if key not in features}
        lost += without
    if rows:
        read = collect_cases(
            rows_of.normalised(pd.concat(rows, ignore_index=True)), features, warm=warm, inexact=inexact
        )
        known = replace(read, cases=(*known.cases, *read.cases), unsolved=known.unsolved + read.unsolved)
    return known, [f"only the sizes are known of {counted(lost, 'problem')} not where they were"] if lost else []


def _at(table: pd.DataFrame, tolerance: float | None, path: Path) -> pd.DataFrame:
    """Return the rows of a tolerance; raises CpbenchError where there are none."""
    if tolerance is None:
        return table
    there = sorted(table["tolerance"].unique())
    if tolerance not in there:
        listed = ", ".join(f"{value:g}" for value in there)
        raise CpbenchError(f"{path}: nothing was measured at --tolerance {tolerance:g}, but at {listed}")
    return table[table["tolerance"] == tolerance]


def _require_none(tolerance: float | None, source: str) -> None:
    """Raise CpbenchError: a table has cases of all tolerances, and does not say which."""
    if tolerance is not None:
        raise CpbenchError(f"{source}: a table does not tell tolerances apart: give --tolerance with --results of runs")


def restricted(labels: Sequence[str], results: Sequence[Path]) -> set[str]:
    """Return the labels whose solver has terms that restrict publishing, by the results or by what is registered
    here."""
    hidden: set[str] = set()
    for path in (path for path in results if path.suffix != ".json"):
        with Store(path) as store:
            sheets = store.meta().get("solvers", {})
        hidden |= {label for label, sheet in sheets.items() if sheet.get("publishing")}
    here = ((label, solver_of(label, "")) for label in labels)
    return (hidden | {label for label, solver in here if solver is not None and solver.spec.publishing}) & set(labels)
