"""Answer of a run, its first section: a sentence a formulation, one figure, and the ranking."""

from __future__ import annotations

import math
from collections.abc import Iterator

from cpbench.analysis import cautions
from cpbench.analysis.profiles import FLOOR
from cpbench.analysis.ranking import RankedSolver, Ranking
from cpbench.analysis.ranking_order import LEVEL
from cpbench.analysis.ranking_sentence import FALSE
from cpbench.foundation.plurals import counted
from cpbench.report import overview_figure
from cpbench.report.details import file_of
from cpbench.report.run import Run
from cpbench.report.text import code, number, plain, seconds, table

SENTENCES = 24
"""The most sentences: those of the formulations with most problems."""
ROWS = 96
"""The most rows of the table of rankings, shared by the formulations."""


HEAD = ("solver", "solved", "lost", "median", "× fastest", "error", "route", "remarks")
EXPLAINED = (
    "Solved: of the problems that the solver was started on; problems that it cannot handle are not counted. Lost: "
    "answers that a conversion lost, which are charged to the conversion and are not among these problems. "
    "Median: of its times where it solved, so solvers that solve different problems have medians of those. "
    "× fastest: geometric mean of its time over that of the fastest solver there. Error: median of what it reached "
    f"where it solved. Order: solvers whose numbers of solved problems do not differ (exact McNemar test, {LEVEL:.0%}) "
    "are in order of time, the geometric mean over all problems, one without an answer charged the limit."
)
"""Meaning of the columns of a ranking, and of its order."""


def answer(run: Run) -> Iterator[str]:
    """Yield the sentences, the figure of the formulations with most problems, and the rankings as one table."""
    ranked = [ranking for ranking in run.rankings if ranking.rows]
    if not ranked:
        return
    most = set(sorted(ranked, key=lambda r: -r.problems)[:SENTENCES])
    shown = [ranking for ranking in ranked if ranking in most]
    disturbed = cautions.disturbance(run.read, run.meta)
    if disturbed:
        yield f"**{plain(disturbed)}**"
    yield "\n".join(_sentence(ranking) for ranking in shown)
    if len(ranked) > len(shown):
        left = counted(len(ranked) - len(shown), "more group")
        yield f"Not shown here: {left} with fewer problems, in `report.html` and `results.csv`."
    name, guide = overview_figure.draw(run, shown)
    if name:
        yield f"[![Performance profiles]({name}.png)]({name}.svg)"
        yield f"*{plain(guide)}*"
    yield "## Ranking"
    lines = max(1, min(10, ROWS // len(shown)))
    rows = [cells for ranking in shown for cells in _lines(run, ranking, lines)]
    yield table(["formulation", *HEAD], rows, right=(2, 3, 4, 5, 6))
    yield f"{EXPLAINED} Times below {seconds(FLOOR)} are set to it."


def _sentence(ranking: Ranking) -> str:
    """Return what to use, after the formulation and what it is called in full."""
    title = f" ({plain(ranking.title)})" if ranking.title else ""
    advice = ranking.advice
    if not advice.winner:
        return f"- **{plain(ranking.formulation)}**{title}: {plain(advice.text)}"
    gap = " " if advice.after.startswith(" ") else ""  # `plain` leaves blanks at the ends out
    sentence = f"{plain(advice.before)} **{code(advice.winner)}**{gap}{plain(advice.after)}"
    return f"- **{plain(ranking.formulation)}**{title}: {sentence}"


def _lines(run: Run, ranking: Ranking, most: int) -> Iterator[list[str]]:
    """Yield the first of its solvers, then how many more there are and which of those made false claims.

    The first line names the formulation and links to its details.
    """
    for k, row in enumerate(ranking.rows[:most]):
        name = f"[{plain(ranking.formulation)}]({file_of(run, ranking.group)})" if k == 0 else ""
        solver, *numbers, route, remarks = cells_of(row)
        yield [name, code(solver), *numbers, plain(route), plain(remarks)]
    rest = ranking.rows[most:]
    if rest:
        lies = [f"{row.solver}: {warning}" for row in rest for warning in row.warnings if warning.startswith(FALSE)]
        yield ["", f"and {len(rest)} more", *[""] * 6, plain("; ".join(lies))]


def cells_of(row: RankedSolver) -> list[str]:
    """Return the cells of a row under HEAD as plain text."""
    route = row.route + (f" and {row.others} more" if row.others else "")
    return [
        row.solver,
        f"{row.solved} of {row.counted}",
        str(row.lost or "·"),
        seconds(row.median),
        number(row.factor),
        f"{row.error:.1e}" if math.isfinite(row.error) else "—",
        route or "—",
        ", ".join(row.warnings),
    ]
