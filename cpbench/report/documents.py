"""The documents of a run: `report.md` on a page or two with its figure, and `details.md` with everything.

Both are templates that show what they make; their numbers are the tables of `tables`, their sentences those of
`sentences`. One fact a line and a fixed order everywhere, so that the difference of two reports reads well.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from cpbench.analysis import bootstrap, certainty, summary
from cpbench.analysis.participation import unreached_lines
from cpbench.analysis.profiles import FLOOR
from cpbench.analysis.ranking_order import LEVEL
from cpbench.analysis.reliability import NEAR
from cpbench.analysis.table import ResultGroup
from cpbench.report import overview_figure, sentences, tables
from cpbench.report.methods import METHODS
from cpbench.report.run import Run, group_name, group_name_text
from cpbench.report.templating import Table, rendered
from cpbench.report.text import plain, seconds
from cpbench.verification import BESIDE


@dataclass(frozen=True)
class ShownGroup:
    """A formulation at one tolerance, start and number of threads, as the documents show it.

    Attributes
    ----------
    name : as Markdown. anchor : of its heading, as hosting sites make it. sizes : ranges of its dimensions.
    """

    name: str
    anchor: str
    problems: int
    pairs: int
    sizes: str
    tables: dict[str, Table]
    beside: str


def write(run: Run, title: str) -> tuple[Path, dict[str, Any]]:
    """Write report.md, its figure and details.md into the folder of the run; returns the path of the first and what the
    templates were given, for the page."""
    run.folder.mkdir(parents=True, exist_ok=True)
    given = context(run, title)
    ranked = [ranking for ranking in run.rankings if ranking.rows]
    given["figure"], given["figure_guide"] = overview_figure.draw(run, ranked)
    path = run.folder / "report.md"
    path.write_text(rendered("report.md.j2", given), encoding="utf-8")
    if len(run.rows):
        (run.folder / "details.md").write_text(rendered("details.md.j2", given), encoding="utf-8")
    return path, given


def context(run: Run, title: str) -> dict[str, Any]:
    """Return what the templates are given: the tables, the sentences and the formulations of a run."""
    levels = certainty.by_problem(run.rows)["level"].value_counts()
    return {
        "title": title,
        "run": run,
        "tables": tables.of_run(run),
        "groups": [_group(run, group, rows) for group, rows in run.parts],
        "sentences": sentences,
        "unreached": unreached_lines(run.meta.get("left_out") or []),
        "certainty": dict.fromkeys(certainty.LEVELS, 0) | levels.to_dict(),
        "methods": METHODS,
        "constants": {"enough": sentences.ENOUGH, "floor": seconds(FLOOR), "level": f"{LEVEL:.0%}", "near": NEAR,
                      "far": certainty.FAR, "families": bootstrap.FEW},
    }  # fmt: skip


def _group(run: Run, group: ResultGroup, rows: pd.DataFrame) -> ShownGroup:
    ranking = next((one for one in run.rankings if one.group == group), None)
    group_tables = tables.of_group(run, group, rows, ranking)
    problems = rows["fingerprint"].nunique()
    sizes = [
        f"{plain(k)} {a}" if a == b else f"{plain(k)} {a} to {b}" for k, (a, b) in summary.size_ranges(rows).items()
    ]
    return ShownGroup(
        name=group_name(run, group),
        anchor=re.sub(r"[^\w -]", "", group_name_text(run, group).lower()).replace(" ", "-"),
        problems=problems,
        pairs=len(rows),
        sizes=", ".join(sizes),
        tables=group_tables,
        beside=BESIDE.get(group.node, ""),
    )
