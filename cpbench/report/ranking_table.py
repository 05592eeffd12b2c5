"""The rankings of a run as tables for a paper: Markdown, or CSV, every number as digits.

Markdown has three digits and times in milliseconds; CSV has every digit, and seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import pandas as pd

from cpbench.analysis.ranking import Ranking
from cpbench.report.templating import Table
from cpbench.report.text import counted, plain

FORMS = {"solver": "code", "solved": "cell", "median [ms]": "number", "× fastest": "number", "error": "number"}
COLUMNS = (
    "formulation", "set", "tolerance", "start", "threads", "measure", "solver", "route", "problems", "counted",
    "solved", "lost", "fastest", "median_s", "times_fastest", "error",
)  # fmt: skip


def as_markdown(rankings: Sequence[Ranking]) -> str:
    """Return a table for each ranking, under its heading."""
    parts: list[str] = []
    for ranking in rankings:
        rows = (
            [row.solver, f"{row.solved} of {row.counted}", 1e3 * row.median, row.factor, row.error]
            for row in ranking.rows
        )
        parts += [f"**{plain(_heading(ranking))}**", Table.of(FORMS, rows).markdown]
    return "\n\n".join(parts) + "\n"


def as_csv(rankings: Sequence[Ranking]) -> str:
    """Return a row for each solver of each ranking; a number that is not there is an empty cell."""
    rows = [
        [one.group.node, one.group.set, one.group.tolerance, one.group.start, one.group.threads, one.group.measure,
         row.solver, row.route, one.problems, row.counted, row.solved, row.lost, row.fastest, row.median, row.factor,
         row.error]
        for one in rankings
        for row in one.rows
    ]  # fmt: skip
    return pd.DataFrame(rows, columns=list(COLUMNS)).to_csv(index=False, lineterminator="\n")


WRITERS: Mapping[str, Callable[[Sequence[Ranking]], str]] = {"md": as_markdown, "csv": as_csv}


def _heading(ranking: Ranking) -> str:
    """Return what the rows of a ranking have in common, with tolerance and start always."""
    group = ranking.group
    words = [f"{group.node}: {counted(ranking.problems, 'problem')}", f"tolerance {group.tolerance:g}"]
    words += [f"{group.start} start"] if group.start else []
    words += [f"set {group.set}"] if group.set else []
    words += [f"{group.threads} threads"] if group.threads > 1 else []
    return ", ".join([*words, *([f"judged by {group.measure}"] if group.measure else [])])
