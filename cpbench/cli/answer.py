"""The answer of a run on the terminal: a ranking of every formulation, and at the end what to use."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from cpbench.analysis.participation import lacking_lines, unreached_lines, unreached_summary
from cpbench.analysis.quotation import quotation
from cpbench.analysis.ranking import RankedSolver, Ranking
from cpbench.analysis.run_table import RunTable
from cpbench.api.cross_examination import contradiction_lines
from cpbench.bench.results.sealed import sealed
from cpbench.cli.terminal import folded, print_lines, width
from cpbench.report.text import counted, number, seconds

if TYPE_CHECKING:
    from rich.table import Table

LINES = 30
"""The most lines on what could not be run."""
FEW = 3
"""The most formulations without a route to some solver that have a line each."""
WIDE, SHORTEST = 400, 16
"""Columns of a table where the output is not a terminal; the least width of names."""


def print_results(path: str) -> None:
    """Print the answer of a results file, as the run that wrote it ended; raises StoreError, SealError."""
    with sealed(Path(path)) as store:
        print_answer(RunTable.of(store.table(), store.meta()))


def print_answer(run: RunTable) -> None:
    """Print the contradictions, the rankings of all formulations, then a sentence each."""
    print_lines([line for found in contradiction_lines(run.contradictions) for line in folded(found)])
    for ranking in run.rankings:
        _print_ranking(ranking)
    left_out = run.meta.get("left_out", [])
    unreached = unreached_lines(left_out)
    many = len(unreached) > FEW
    reasons = [*lacking_lines(left_out), *(() if many else unreached)]
    for line in reasons[:LINES]:
        print_lines([_fitted(line)])
    if many:
        print_lines(folded(unreached_summary(left_out)))
    if many or any(_fitted(line) != line for line in reasons[:LINES]):
        print_lines(folded("why: cpbench route PROBLEM --explain, and the report"))
    if len(reasons) > LINES:
        click.echo(f"and {counted(len(reasons) - LINES, 'more reason')} why pairs could not be run")
    if quoted := quotation(run.meta):
        print_lines(folded(quoted))
    lines = [line for ranking in run.rankings for line in _sentence(ranking)]
    first = [click.style(line, fg="yellow") for line in folded(run.disturbance)] if run.disturbance else []
    click.echo("\n".join(["", *([*first, "Which solver to use:"] if lines else []), *lines]))


def _title(ranking: Ranking) -> str:
    return f" ({ranking.title})" if ranking.title else ""


def _sentence(ranking: Ranking) -> Sequence[str]:
    """Return the solver to use, after the formulation and its full name, in lines of the terminal with both bold."""
    opening = f"{ranking.formulation}{_title(ranking)}: {ranking.advice.before}"
    first, *rest = folded(f"{ranking.formulation}{_title(ranking)}: {ranking.verdict}")
    if first.startswith(opening + ranking.winner):  # the opening may be longer than a line
        first = opening + click.style(ranking.winner, bold=True) + first.removeprefix(opening + ranking.winner)
    return [click.style(ranking.formulation, bold=True) + first.removeprefix(ranking.formulation), *rest]


def _print_ranking(ranking: Ranking) -> None:
    from rich.table import Table
    from rich.text import Text

    head = folded(f"{ranking.formulation}{_title(ranking)}: {ranking.problems_and_starts}")
    click.secho("\n".join(head), bold=True)  # not as title of the table, which would fold it to the table's width
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    room = width()
    most = None if room is None else max(room // 4, SHORTEST)
    table.add_column("solver", no_wrap=True, overflow="ellipsis", max_width=most)
    for name in ("solved", "lost", "median", "× fastest", "error"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("route", no_wrap=True, overflow="ellipsis", max_width=most)
    table.add_column("", overflow="fold")
    for row in ranking.shown:
        table.add_row(*map(Text, _cells(row)))
    _print_table(table)
    left = len(ranking.rows) - len(ranking.shown)
    click.echo(f"and {counted(left, 'more solver')}\n" if left else "")


def _print_table(table: Table) -> None:
    from rich.console import Console

    console = Console(file=sys.stdout, width=width() or WIDE, highlight=False, markup=False, emoji=False)
    with console.capture() as captured:
        console.print(table)
    for line in captured.get().splitlines():
        click.echo(line.rstrip())


def _cells(row: RankedSolver) -> Sequence[str]:
    timed = math.isfinite(row.median)
    more = f" (+{row.others})" if row.others else ""
    return (
        row.solver,
        f"{row.solved} of {row.counted}",
        str(row.lost or "·"),
        seconds(row.median) if timed else "—",
        number(row.factor) if timed else "—",
        f"{row.error:.1e}" if math.isfinite(row.error) else "—",
        f"{row.route}{more}",
        ", ".join(row.warnings),
    )


def _fitted(line: str) -> str:
    """Return a line in the width of the terminal, without its reason where both do not fit; elsewhere as it is."""
    room = width()
    if room is None or len(line) <= room:
        return line
    what = line.partition(": ")[0]
    return what if len(what) <= room else f"{line[: room - 1]}…"
