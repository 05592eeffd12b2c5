"""The rankings of a run as tables for a paper: Markdown, or CSV, every number as digits.

Markdown has three digits and times in milliseconds; CSV has every digit, and seconds.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterator, Mapping, Sequence

from cpbench.analysis.ranking import RankedSolver, Ranking
from cpbench.report import text
from cpbench.report.text import counted

HEAD = ("solver", "solved", "median [ms]", "× fastest", "error")
CSV_HEAD = (
    "formulation", "set", "tolerance", "start", "threads", "measure", "solver", "route", "problems", "counted",
    "solved", "lost", "fastest", "median_s", "times_fastest", "error",
)  # fmt: skip


def as_markdown(rankings: Sequence[Ranking]) -> str:
    """Return a table for each ranking, under its heading."""
    parts: list[str] = []
    for ranking in rankings:
        rows = [[text.code(row.solver), *_cells(row)] for row in ranking.rows]
        parts += [f"**{text.plain(_heading(ranking))}**", text.table(HEAD, rows, right=range(1, len(HEAD)))]
    return "\n\n".join(parts) + "\n"


def as_csv(rankings: Sequence[Ranking]) -> str:
    """Return a row for each solver of each ranking; a number that is not there is an empty cell."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(CSV_HEAD)
    for ranking in rankings:
        group = ranking.group
        where = [group.node, group.set, group.tolerance, group.start, group.threads, group.measure]
        for row in ranking.rows:
            numbers = (row.median, row.factor, row.error)
            counts = [ranking.problems, row.counted, row.solved, row.lost, row.fastest]
            writer.writerow([*where, row.solver, row.route, *counts, *(repr(n) if n == n else "" for n in numbers)])
    return out.getvalue()


WRITERS: Mapping[str, Callable[[Sequence[Ranking]], str]] = {"md": as_markdown, "csv": as_csv}


def _heading(ranking: Ranking) -> str:
    """Return what the rows of a ranking have in common, with tolerance and start always."""
    group = ranking.group
    words = [f"{group.node}: {counted(ranking.problems, 'problem')}", f"tolerance {group.tolerance:g}"]
    words += [f"{group.start} start"] if group.start else []
    words += [f"set {group.set}"] if group.set else []
    words += [f"{group.threads} threads"] if group.threads > 1 else []
    return ", ".join([*words, *([f"judged by {group.measure}"] if group.measure else [])])


def _cells(row: RankedSolver) -> tuple[str, ...]:
    return f"{row.solved} of {row.counted}", *_numbers(row)


def _numbers(row: RankedSolver) -> Iterator[str]:
    for value in (1e3 * row.median, row.factor, row.error):
        yield text.number(value) if math.isfinite(value) else "—"
