"""The Markdown report of a run: `report.md`, on a page or two, its details, its figures and `results.csv`.

One fact a line and a fixed order everywhere, so that the difference of two reports reads well.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from cpbench.analysis import table as rows_of
from cpbench.analysis.participation import REFUSED
from cpbench.report.answer import answer
from cpbench.report.conditions import conditions
from cpbench.report.details import WHOLE_RUN, file_of, write_details
from cpbench.report.known_sections import known_sections
from cpbench.report.participation_sections import publishing
from cpbench.report.run import Run, group_name
from cpbench.report.run_sections import contradictions
from cpbench.report.text import counted, plain
from cpbench.verification import Status

if TYPE_CHECKING:
    from cpbench.analysis.comparison import Comparison

CONTRADICTIONS = 12
"""The most contradictions that are listed here."""
LINKED = 40
"""The most files of details that are linked."""


def write_text(run: Run, title: str, comparison: Comparison | None = None) -> Path:
    """Write report.md, its details and their figures into the folder of the run."""
    run.folder.mkdir(parents=True, exist_ok=True)
    parts = [
        f"# {plain(title)}",
        *publishing(run),
        *([f"**{run.incomplete}**"] if run.incomplete else []),
        *_remarks(run),
        *contradictions(run, CONTRADICTIONS),
        *answer(run),
        _headline(run),
    ]
    if comparison is not None:
        from cpbench.report.comparison.markdown import section as comparison_section

        parts += comparison_section(comparison)
    parts += [*known_sections(run), *conditions(run), *_pointers(run)]
    path = run.folder / "report.md"
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    if len(run.rows):
        write_details(run, title)
    return path


def _headline(run: Run) -> str:
    """Return how much was run and with which results; pairs that could not be run are counted apart."""
    if not len(run.rows):
        return "No pair was planned: no solver is reached from the problems that were read."
    rows = run.rows
    never = int(rows["status"].isin(REFUSED).sum())
    waiting = int((rows["status"] == str(Status.NOT_RUN)).sum())
    problems, labels = run.read["fingerprint"].nunique(), rows["label"].nunique()
    lines = [
        f"**{int(rows_of.solved(rows).sum())} of {counted(len(rows) - never, 'pair')} solved** "
        f"({counted(problems, 'problem')}, {counted(labels, 'solver configuration')}); "
        f"{counted(len(run.false_claims), 'false claim')}."
    ]
    if never > waiting:
        lines.append(f"{counted(never - waiting, 'more pair')} could not be run, and are not counted.")
    if run.stationary:
        lines.append(f"{run.stationary.capitalize()}.")
    return "\\\n".join(lines)


def _remarks(run: Run) -> Iterator[str]:
    """Yield what was requested of the run and not done."""
    if run.remarks:
        yield "\\\n".join(f"**{plain(remark)}.**" for remark in run.remarks)


def _pointers(run: Run) -> Iterator[str]:
    """Yield where the rest is."""
    yield "## Where the details are"
    lines = ["- `report.html`: every figure and pair, filtered as you like; offline, in any browser"]
    if run.has_csv:
        lines.append("- `results.csv`: every row")
    if len(run.rows):
        lines.append(f"- [{WHOLE_RUN}]({WHOLE_RUN}): every reason of failure, solvers, what every number means")
        links = [f"[{group_name(run, group)}]({file_of(run, group)})" for group, _ in run.parts]
        more = f" and {len(links) - LINKED} more" if len(links) > LINKED else ""
        lines.append(f"- means, claims, families and unsolved problems: {', '.join(links[:LINKED])}{more}")
    yield "\n".join(lines)
