"""The Markdown report of a run: `report.md`, its figures and `results.csv` in one folder.

One fact a line and a fixed order everywhere, so that the difference of two reports reads well.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from cpbench.analysis import table as rows_of
from cpbench.report import row_files
from cpbench.report.attendance_sections import publishing
from cpbench.report.easel import FEW, Easel, cores
from cpbench.report.group_sections import group_sections
from cpbench.report.html.columns import KEPT, WHOLE
from cpbench.report.meanwhile import meanwhile
from cpbench.report.methods import METHODS
from cpbench.report.run import Run, each, group_name
from cpbench.report.run_sections import run_sections
from cpbench.report.text import code, counted, listed, plain
from cpbench.report.text import table as text_table
from cpbench.verification import Status

if TYPE_CHECKING:
    from cpbench.analysis.comparison import Comparison

MANY = (
    "numbers and curves are of all of them; lists of pairs are cut short, and `report.html` has the facts of single "
    f"pairs for at most {KEPT} failures"
)
"""What is said where rows are too many to show each."""


def rows_beside(run: Run) -> AbstractContextManager[None]:
    """results.csv, if it is to be there, by the time this is left; meanwhile, by a copy of this process, where rows are
    many."""
    run.folder.mkdir(parents=True, exist_ok=True)
    if not run.has_csv:
        return nullcontext()
    write_rows = partial(row_files.write, run.timed, run.folder / "results.csv")
    return meanwhile(write_rows, copied=len(run.rows) > WHOLE and cores() > 1)


def easel_of(run: Run) -> Easel:
    """What draws the figures of report.md; all are there when it is left."""
    return Easel(run.folder, few=FEW if len(run.rows) <= WHOLE else 0)


def write_text(run: Run, easel: Easel, title: str, comparison: Comparison | None = None) -> Path:
    """report.md; `easel` is given its figures."""
    parts = [f"# {plain(title)}", _headline(run), _facts(run), *publishing(run), *_overview(run)]
    if comparison is not None:
        from cpbench.report.comparison.markdown import section as comparison_section

        parts += comparison_section(comparison)
    several = len(run.parts) > run.rows["node"].nunique()
    for group, rows in run.parts:
        parts += group_sections(run, easel, group, rows, several)
    parts += run_sections(run)
    parts += ["## Methods", METHODS.strip()]
    path = run.folder / "report.md"
    path.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return path


def _headline(run: Run) -> str:
    if not len(run.rows):
        return "No pair was planned: no solver is reached from the problems that were read."
    rows = run.rows
    lies = len(run.false_claims)
    problems, labels = rows["fingerprint"].nunique(), rows["label"].nunique()
    first = (
        f"**{counted(int(rows_of.solved(rows).sum()), 'pair')} of {len(rows)} solved** "
        f"({counted(problems, 'problem')}, {counted(labels, 'solver configuration')}); "
        f"{counted(lies, 'claim does', 'claims do')} not hold."
    )
    if run.stationary:
        first += f"\\\n{run.stationary.capitalize()}."
    first += "".join(f"\\\n{plain(remark)}." for remark in run.remarks)
    waiting = int((rows["status"] == str(Status.NOT_RUN)).sum())
    if waiting:
        first = f"**Incomplete: {waiting} of {counted(len(rows), 'pair')} not run yet.**\\\n{first}"
    best = [
        f"{group_name(run, r.group)}: {listed(r.best, 3)} ({r.most} of {r.problems})"
        if r.best
        else f"{group_name(run, r.group)}: nothing solved"
        for r in each(run.nodes)
    ]
    return f"{first}\\\nMost solved: {'; '.join(best)}."


def _facts(run: Run) -> str:
    meta = run.meta
    tolerances = sorted(run.rows["tolerance"].unique())
    facts = {
        "tolerance": ", ".join(f"{t:g}" for t in tolerances),
        "limit": _all_of(run, "seconds", "{:g} s a solve"),
        "threads": _all_of(run, "threads", "{:g}"),
        "repeats": _all_of(run, "repeats_asked", "{:g} of short solves"),
        "start": ", ".join(sorted(set(run.rows["start"].unique()) - {""})),
        "run on": meta.get("date", ""),
        "random order": f"seed {meta['seed']}" if meta.get("seed") is not None else "",
        "rows": f"{run.all_rows}, one a pair" if len(run.rows) else "",
        "many rows": MANY if len(run.rows) > WHOLE else "",
    }
    lines = [f"- {name}: {value}" for name, value in facts.items() if str(value)]
    command = str(meta.get("command", "")).replace(str(Path.cwd()) + os.sep, "")
    return "\n".join([*lines, f"- command: {code(command)}"])


def _all_of(run: Run, column: str, form: str) -> str:
    """The values of a limit over all rows; "none" stands for an infinite one."""
    values = sorted(run.rows[column].dropna().unique())
    return ", ".join(form.format(v) if math.isfinite(v) else "none" for v in values)


def _overview(run: Run) -> Iterator[str]:
    found = run.nodes
    if not len(found):
        return
    yield "## Solved, by formulation"
    head = ["formulation", "problems", "configurations", "pairs", "solved by some", "by none", "most solved", "by"]
    yield text_table(
        head,
        (
            [
                group_name(run, r.group),
                str(r.problems),
                str(r.labels),
                str(r.pairs),
                str(r.some),
                str(r.none),
                str(r.most),
                listed(r.best) if r.best else "—",
            ]
            for r in each(found)
        ),
        right=range(1, 7),
    )
