"""Several results files as one table of how solvers did over time, and the files that show it."""

from __future__ import annotations

import fnmatch
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd

from cpbench.advice import timeline_tables
from cpbench.advice.timeline import TimelineRun, timeline
from cpbench.analysis import participation
from cpbench.bench.results.sealed import sealed
from cpbench.errors import CpbenchError, FormatError, StoreError, UnknownName


@dataclass(frozen=True)
class SolverHistory:
    """Results over time: what each label solved in every file, and how fast (`points`), with remarks on the files."""

    points: pd.DataFrame
    remarks: tuple[str, ...] = ()

    def lines(self) -> list[str]:
        """Return the points as a table of text."""
        return list(timeline_tables.columns(self.points))

    def write(self, path: Path) -> None:
        """Write a table (.md, .csv, .json) or a figure (.svg, .png); raises CpbenchError where that cannot be."""
        if not path.absolute().parent.is_dir():
            raise CpbenchError(f"{path}: there is no folder {path.parent}; make it first")
        if path.suffix in (".svg", ".png"):
            from cpbench.advice.timeline_figure import timeline_figure, write

            write(timeline_figure(self.points, f"{self.points['file'].nunique()} runs"), path)
            return
        text = {
            ".md": lambda: timeline_tables.markdown(self.points, path.stem),
            ".csv": lambda: timeline_tables.as_csv(self.points),
            ".json": lambda: timeline_tables.as_json(self.points),
        }[path.suffix]()
        try:
            path.write_text(text, encoding="utf-8", newline="\n")
        except OSError as cause:
            raise FormatError(path, "", f"cannot be written ({cause.strerror or cause})") from None


def history(files: Sequence[Path], labels: Sequence[str] = ()) -> SolverHistory:
    """Return how the solvers of several results files did, file by file in the order of their dates.

    Parameters
    ----------
    files : results files; a file twice counts once. labels : labels or globs to keep, all for none.

    Raises StoreError where no file has a row that was run, UnknownName on a label that no file has.
    """
    remarks: list[str] = []
    runs: list[TimelineRun] = []
    for path in dict.fromkeys(path.resolve() for path in files):
        with sealed(path) as store:
            table, meta, machines = store.table(), store.meta(), store.machines()
        terms = participation.restricted(table, meta.get("solvers") or {})
        if terms:
            remarks.append(f"{path}: licences restrict publishing figures of {', '.join(terms)}")
        if table["status"].isin(["not_run", "unavailable"]).all():
            remarks.append(f"{path}: no pair was run; left out")
        else:
            runs.append(_run(path, table, meta, machines))
    if not runs:
        raise StoreError("none of the files has a row that was run: nothing to show; cpbench run PROBLEMS makes some")
    points = timeline(_named(runs))
    known = sorted(set(points["label"]))
    for pattern in labels:
        if not _matches(pattern, known):
            raise UnknownName("label", pattern, known)
    if labels:
        chosen = {label for pattern in labels for label in _matches(pattern, known)}
        points = points[points["label"].isin(chosen)].reset_index(drop=True)
    return SolverHistory(points, tuple(remarks))


def _run(path: Path, table: pd.DataFrame, meta: Mapping[str, Any], machines: Mapping[str, Any]) -> TimelineRun:
    return TimelineRun(
        str(path),
        table,
        str(meta.get("cpbench") or ""),
        machines,
        meta.get("machine") or {},
        str(meta.get("date") or ""),
        [solve["seconds"] for solve in meta["references"]],
        str(meta.get("reference") or ""),
    )


def _matches(pattern: str, labels: Sequence[str]) -> list[str]:
    return [label for label in labels if label == pattern or fnmatch.fnmatchcase(label, pattern)]


def _named(runs: Sequence[TimelineRun]) -> list[TimelineRun]:
    """Return the runs, each named by as much of its path as distinguishes it."""
    parts = 1
    while len({Path(run.name).parts[-parts:] for run in runs}) < len(runs):
        parts += 1
    return [replace(run, name=str(Path(*Path(run.name).parts[-parts:]))) for run in runs]
