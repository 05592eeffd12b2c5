"""The details behind report.md: `details.md` about all rows together, and `details-NAME.md` of each formulation."""

from __future__ import annotations

from pathlib import Path

from cpbench.analysis.table import ResultGroup
from cpbench.report.group_sections import group_sections, slug_of
from cpbench.report.methods import METHODS
from cpbench.report.run import Run, group_name
from cpbench.report.run_sections import run_sections
from cpbench.report.text import plain

WHOLE_RUN = "details.md"


def file_of(run: Run, group: ResultGroup) -> str:
    """Return the name of the file with the details of a group."""
    return f"details-{slug_of(run, group)}.md"


def write_details(run: Run, title: str) -> None:
    """Write all of them and their figures into the folder of the run."""
    for group, rows in run.parts:
        head = f"# {plain(title)}: {group_name(run, group)}"
        _write(run.folder / file_of(run, group), [head, *group_sections(run, group, rows)])
    parts = [f"# {plain(title)}: all formulations", *run_sections(run), "## Methods", METHODS.strip()]
    _write(run.folder / WHOLE_RUN, parts)


def _write(path: Path, parts: list[str]) -> None:
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
