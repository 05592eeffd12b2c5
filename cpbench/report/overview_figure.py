"""The figure of a whole run: a performance profile a formulation, the leading solvers named below each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from cpbench.analysis import table as rows_of
from cpbench.analysis.profiles import Profile
from cpbench.analysis.ranking import Ranking
from cpbench.report import canvas, figures
from cpbench.report.figure_kinds import Drawing
from cpbench.report.run import Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAME = "answer.png"
"""Name of its file."""
PANELS = 12
"""The most formulations: those with most problems, of equally many those with most solves."""
ACROSS, NAMED = 3, 4
"""Panels a row; solvers named below each."""
TIGHT = 0.04
"""Margin above and below the curves, so that one along an end is seen."""
WIDTH, HIGH = 9.2, 2.5
"""Width of the figure, height of a panel with its axis and names [in]."""
LEFT, RIGHT, GAP, TITLE, NAMES = 0.3, 0.1, 0.45, 0.25, 1.0
"""Widths left and right of the axes and between two, heights of the title and of the names of a panel [in]."""


def draw(run: Run, rankings: Sequence[Ranking]) -> tuple[str, str]:
    """Draw the figure into the folder of the run; gives its name and how to read it, ('', '') where no two solvers
    solved something that they could be compared on.
    """
    panels = [ranking for ranking in chosen(rankings) if run.compared[ranking.group].profile.compares]
    if not panels:
        return "", ""
    rows_across = dict(run.parts)
    across = min(ACROSS, len(panels))
    down = -(-len(panels) // across)
    with canvas.drawing(formulas=False):
        figure = canvas.page(WIDTH, down * HIGH)
        high = HIGH - TITLE - NAMES
        wide = (WIDTH - LEFT + GAP - RIGHT) / across - GAP
        for k, ranking in enumerate(panels):
            # places are given, since a layout that measures every word takes as long as to draw it
            left, below = LEFT + (k % across) * (wide + GAP), (down - 1 - k // across) * HIGH + NAMES
            axes = figure.add_axes((left / WIDTH, below / down / HIGH, wide / WIDTH, high / down / HIGH))
            kinds = rows_of.label_kinds(rows_across[ranking.group])
            _panel(axes, ranking, run.compared[ranking.group].profile, kinds, run.line_styles)
    canvas.write(Drawing(figure, "", ""), run.folder / NAME, bare=True)
    left_out = ""
    if len(panels) < len(rankings):
        left_out = (
            f" {len(panels)} of {len(rankings)} formulations are shown, those with most problems, then most solves."
        )
    return NAME, (
        "A curve at τ is the fraction of the problems that the solver solved within τ times the time of the fastest "
        "solver of that problem: at the left end where it was the fastest, at the right end at all. Below each panel: "
        f"the solvers with the largest area under their curves, and how many problems each solved.{left_out}"
    )


def chosen(rankings: Sequence[Ranking]) -> list[Ranking]:
    """Return the rankings that get a panel, in their order: those of several solvers. A curve alone says nothing."""
    compared = [r for r in rankings if sum(row.solved > 0 for row in r.rows) > 1]
    most = sorted(compared, key=lambda r: (-r.problems, -sum(row.solved for row in r.rows)))[:PANELS]
    return [r for r in rankings if r in most]


def _panel(axes: Axes, ranking: Ranking, profile: Profile, kinds: Mapping[str, str], styles: Mapping[str, int]) -> None:
    """Draw the curves, and below them a line a named solver, the best first: its style, what it solved, its name."""
    ranks = {row.solver: k for k, row in enumerate(ranking.rows)}
    named = profile.leading(NAMED)
    curves = sorted(profile.curves, key=lambda curve: ranks.get(curve.label, len(ranks)))
    lines = figures.profile_lines(profile, curves, named, styles, kinds)
    figures.draw_lines(axes, lines, clip_on=False, linewidth=1.4, markersize=3)
    figures.profile_scales(axes, profile, 6)
    axes.set_ylim(-TIGHT, 1.0 + TIGHT)
    axes.set_yticks([0.0, 0.5, 1.0])
    axes.set_xlabel("τ: time / fastest time", fontsize=6.8, labelpad=1.5)
    axes.set_title(f"{ranking.formulation}  ({profile.problems})", fontsize=8.5, loc="left", fontweight="bold", pad=3)
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.28), fontsize=7.2, borderaxespad=0.0, labelspacing=0.3)
