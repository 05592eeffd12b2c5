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
from cpbench.analysis.bootstrap import FEW, REPLICATES
from cpbench.analysis.means import WITHIN
from cpbench.analysis.participation import unreached_lines
from cpbench.analysis.profiles import FLOOR
from cpbench.analysis.ranking_order import LEVEL
from cpbench.analysis.reliability import NEAR
from cpbench.analysis.table import ResultGroup
from cpbench.formulations.base import Kind
from cpbench.report import overview_figure, sentences, tables
from cpbench.report.figures import EMPHASISED
from cpbench.report.run import Run, group_name, group_name_text
from cpbench.report.templating import Table, rendered
from cpbench.report.text import plain, seconds
from cpbench.verification import BESIDE, DIRECTION_DEGREES, INACCURATE_FACTOR, TARGET_UNRESOLVABLE

FLAGS = {
    "unresolvable": "rounding decides whether the answer meets the tolerance",
    TARGET_UNRESOLVABLE: "rounding decides whether the answer meets the tolerance on the solver's own problem",
    "direction": f"accepted, but some contact slips more than {DIRECTION_DEGREES:g}° off the direction that the law "
    "prescribes",
    "contact": "accepted, but a contact that carries load misses the law by more than a tenth of its own reaction or "
    "velocity",
    "scale": "the natural residual passes and the energy norm does not",
    "absolute": "a part of the problem has no constants, and was measured absolutely",
    "repeat": "a repeat of the timing failed after the first answer, which stands",
    "remembered": "the repeats were so much faster than the first solve that it alone counts",
    "twice": "the package of the solver claimed an answer, by a test and in its own units, that misses the "
    "tolerance, and was asked once more, for a smaller tolerance",
    "children": "the solver left processes behind",
    "threads": "it used more threads than it was given",
    "wrote": "it wrote to the problem's data",
    "clock": "its answer came much later than its own clock says, and the time is the runner's, with all that passed "
    "until the answer was there",
}
"""Meaning of the flags of a row."""
KINDS = {
    Kind.EQUIVALENT: "every answer there is an answer here, and the other way round",
    Kind.ONE_WAY: "every answer there is an answer here",
    Kind.NECESSARY: "promises less than an answer: a necessary condition",
    Kind.APPROXIMATE: "promises less than an answer: the law is approximated",
    Kind.RELAXATION: "promises less than an answer: a part of the law is dropped",
}
"""Promise of a route."""


METHODS = (
    (Path(__file__).parent / "methods.md")
    .read_text(encoding="utf-8")
    .format(
        flags="; ".join(f"*{name}*: {meaning}" for name, meaning in FLAGS.items()),
        inaccurate=INACCURATE_FACTOR,
        floor=seconds(FLOOR),
        emphasised=EMPHASISED,
        replicates=REPLICATES,
        few=FEW,
        within=WITHIN,
    )
)


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
