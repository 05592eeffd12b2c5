"""What every section of a report is made from: the rows, the facts of the run, and the folder."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.histories import COLUMNS as HISTORY_COLUMNS
from cpbench.analysis.table import Group
from cpbench.report.text import counted, plain


@dataclass(frozen=True)
class Run:
    """The rows of a run, in fixed order, with the facts of the run, where the report goes, judged iterates
    (`analysis.histories`) of the solves that were recorded, and the restrictions on publishing, by name, of solvers
    that are left out."""

    rows: pd.DataFrame
    meta: Mapping[str, Any]
    folder: Path
    histories: pd.DataFrame = field(default_factory=lambda: pd.DataFrame(columns=list(HISTORY_COLUMNS)))
    left_out: Mapping[str, str] = field(default_factory=dict)


def group_name(run: Run, group: Group) -> str:
    """The formulation, with what tells it from other groups of the same formulation."""
    others = [g for g, _ in rows_of.groups(run.rows) if g.node == group.node]
    parts = [plain(group.node)]
    if len({g.tolerance for g in others}) > 1:
        parts.append(f"tolerance {group.tolerance:g}")
    if len({g.start for g in others}) > 1:
        parts.append(f"{plain(group.start)} start")
    if len({g.threads for g in others}) > 1:
        parts.append(counted(group.threads, "thread"))
    if len({g.set for g in others}) > 1 and group.set:
        parts.insert(1, f"set {plain(group.set)}")
    if len({g.measure for g in others}) > 1:
        parts.append(f"judged by {plain(group.measure)}" if group.measure else "judged by all measures")
    return ", ".join(parts)


def tunings(run: Run) -> dict[str, Mapping[str, Any]]:
    """How the options of tuned solvers were found, by label."""
    sheets: Mapping[str, Mapping[str, Any]] = run.meta.get("solvers") or {}
    return {label: sheet["tuned"] for label, sheet in sheets.items() if sheet.get("tuned")}


def each(frame: pd.DataFrame) -> Iterator[Any]:
    """The rows of a frame, its columns as attributes."""
    yield from frame.itertuples(index=False)
