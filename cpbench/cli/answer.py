"""The answer of a run on the terminal: a ranking of every formulation, and at the end what to use."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import click

from cpbench.analysis.participation import lacking_lines, unreached_lines, unreached_summary
from cpbench.analysis.ranking import Ranking
from cpbench.analysis.run_table import RunTable, quotation
from cpbench.api.concluding import contradiction_lines
from cpbench.bench.results.store import Store
from cpbench.cli.terminal import folded, print_lines, width
from cpbench.foundation.text import counted
from cpbench.report.sentences import solved_most
from cpbench.report.text import listed_plainly

LINES = 30
"""The most lines on what could not be run."""
FEW = 3
"""The most formulations without a route to some solver that have a line each."""
HEAD = ("", "solver", "solved", "lost", "median", "× fastest", "error", "route", "remarks")
LOST, ROUTE, WARNINGS = 3, 7, 8
"""Numbers of columns."""
NONE, GAP = "·", 2
"""A loss that did not happen; blanks between two columns."""
MOST, BEST = 10, 3
"""The most solvers of a formulation that are shown, and that of each where there are more than FEW formulations."""
WIDE, SHORTEST = 400, 16
"""Columns of a table where the output is not a terminal; the least width of names."""


def print_results(path: str) -> None:
    """Print the answer of a results file, as the run that wrote it ended; raises StoreError."""
    with Store(Path(path)) as store:
        print_answer(RunTable.of(store.table(), store.meta()))


def print_answer(run: RunTable) -> None:
    """Print the contradictions, the rankings of all formulations, then a sentence each."""
    print_lines([line for entry in contradiction_lines(run.contradictions) for line in folded(entry)])
    _print_rankings(run.rankings)
    left_out = run.meta.get("left_out", [])
    unreached = unreached_lines(left_out)
    many = len(unreached) > FEW
    reasons = [*lacking_lines(left_out), *(() if many else unreached)]
    for line in reasons[:LINES]:
        print_lines([_fitted(line)])
    if many:
        print_lines(folded(unreached_summary(left_out)))
    if many or any(_fitted(line) != line for line in reasons[:LINES]):
        print_lines(folded("why: cpbench graph PROBLEM --explain, and the report"))
    if len(reasons) > LINES:
        click.echo(f"and {counted(len(reasons) - LINES, 'more reason')} why pairs could not be run")
    if quoted := quotation(run.meta):
        print_lines(folded(quoted))
    lines = [line for ranking in run.rankings for line in _sentence(ranking, run)]
    warning = [click.style(line, fg="yellow") for line in folded(run.disturbance) if line]
    first = warning or ["Which solver to use:"]
    click.echo("\n".join(["", *(first if lines else []), *lines]))


def _sentence(ranking: Ranking, run: RunTable) -> Sequence[str]:
    """Return the solver to use, after the formulation and its full name, in lines of the terminal with both bold; where
    times were disturbed, the solvers that solved most."""
    opening = f"{ranking.formulation}{ranking.bracketed_title}: {ranking.advice.before}"
    withheld = run.disturbance and ranking.advice.winner and len(ranking.rows) > 1
    text = solved_most(ranking, listed_plainly, run.noise) if withheld else ranking.verdict
    first, *rest = folded(f"{ranking.formulation}{ranking.bracketed_title}: {text}")
    if first.startswith(opening + ranking.winner):  # the opening may be longer than a line
        first = opening + click.style(ranking.winner, bold=True) + first.removeprefix(opening + ranking.winner)
    return [click.style(ranking.formulation, bold=True) + first.removeprefix(ranking.formulation), *rest]


def _print_rankings(rankings: Sequence[Ranking]) -> None:
    """Print one table: the best solvers of each formulation, fewer of each where there are many formulations."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from cpbench.report.tables import ranking_table
    from cpbench.report.templating import AS_TEXT

    lines: list[Sequence[Text]] = []
    for ranking in rankings:
        shown = ranking.rows[: MOST if len(rankings) <= FEW else BEST]
        left = len(ranking.rows) - len(shown)
        more = f"+ {counted(left, 'solver')}" if left else ""
        beside = [Text(ranking.formulation, style="bold"), Text(ranking.problems_and_starts), Text(more)]
        if len(shown) == 1:
            beside[0].append(f", {ranking.problems_and_starts}")
        made = ranking_table(shown)
        columns = [list(made.forms).index(name) for name in HEAD[1:]]
        for cells in made.cells(AS_TEXT):
            lines.append([beside.pop(0) if beside else Text(), *(Text(cells[k]) for k in columns)])
    if not lines:
        return
    room = width() or WIDE
    # numbers are never cut: routes have the room that is left, and warnings fold
    heads = [*HEAD[:WARNINGS], ""]
    widths = [max(len(name), *(len(line[k]) for line in lines)) for k, name in enumerate(heads)]
    fixed = [k for k in range(ROUTE) if k != LOST or any(line[k].plain != NONE for line in lines)]
    left = room - sum(widths[k] + GAP for k in fixed)
    warned = any(line[WARNINGS].plain for line in lines)
    warning_width = min(widths[WARNINGS], max(left - SHORTEST - GAP, SHORTEST)) + GAP if warned else 0
    table = Table(box=None, pad_edge=False, padding=(0, GAP, 0, 0), header_style="")
    for k in fixed:
        table.add_column(HEAD[k], justify="left" if k < 2 else "right", no_wrap=True)
    shown = [*fixed, *([ROUTE] if left - warning_width >= SHORTEST else []), *([WARNINGS] if warned else [])]
    if ROUTE in shown:
        table.add_column(HEAD[ROUTE], no_wrap=True, overflow="ellipsis", max_width=left - warning_width - GAP)
    if warned:
        table.add_column(overflow="fold")
    for line in lines:
        table.add_row(*(line[k] for k in shown))
    wide = room + max(warning_width - left, 0)  # a narrow terminal breaks lines, rather than that a warning is lost
    console = Console(file=sys.stdout, width=wide, highlight=False, markup=False, emoji=False)
    with console.capture() as captured:
        console.print(table)
    for text in captured.get().splitlines():
        click.echo(text.rstrip())


def _fitted(line: str) -> str:
    """Return a line in the width of the terminal, without its reason where both do not fit; elsewhere as it is."""
    room = width()
    if room is None or len(line) <= room:
        return line
    what = line.partition(": ")[0]
    return what if len(what) <= room else f"{line[: room - 1]}…"
