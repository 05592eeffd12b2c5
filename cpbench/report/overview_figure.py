"""The figure of a whole run: a performance profile a formulation, the leading solvers named below each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pandas as pd

from cpbench.analysis import table as rows_of
from cpbench.analysis.profiles import Profile
from cpbench.analysis.ranking import Ranking
from cpbench.report import legend
from cpbench.report.figures import INEXACT, STYLE, frame, marked, right_end, save
from cpbench.report.run import ComparedTimes, Run

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAME = "answer"
"""Name of its files, without a suffix."""
PANELS = 12
"""The most formulations: those with most problems, of equally many those with most solves."""
ACROSS, NAMED = 3, 4
"""Panels a row; solvers named below each."""
POINTS = 400
TIGHT = 0.04
"""Margin above and below the curves, so that one along an end is seen."""
WIDTH, HIGH = 9.2, 2.6
"""Width of the figure, height of a panel with its axis and names [in]."""


@dataclass(frozen=True)
class Panel:
    """A formulation with its profile, the kinds of routes, and the labels that are in colour, as they rank."""

    name: str
    profile: Profile
    kinds: Mapping[str, str]
    named: tuple[str, ...]


def draw(run: Run, rankings: Sequence[Ranking]) -> tuple[str, str]:
    """Draw the figure into the folder of the run; gives its name and how to read it, ('', '') where no two solvers
    solved something that they could be compared on.
    """
    rows = dict(run.parts)
    panels = [panel for r in chosen(rankings) if (panel := _panel(r, rows[r.group], run.compared[r.group])) is not None]
    if not panels:
        return "", ""
    save(overview_figure(panels, run.looks), run.folder, NAME)
    left = ""
    if len(panels) < len(rankings):
        left = f" {len(panels)} of {len(rankings)} formulations are shown, those with most problems, then most solves."
    return NAME, (
        "A curve at τ is the fraction of the problems that the solver solved within τ times the time of the fastest "
        "solver of that problem: at the left end where it was the fastest, at the right end at all. Below each panel: "
        f"the solvers with the largest area under their curves, and how many problems each solved.{left}"
    )


def chosen(rankings: Sequence[Ranking]) -> list[Ranking]:
    """Return the rankings that get a panel, in their order: those of several solvers. A curve alone says nothing."""
    compared = [r for r in rankings if sum(row.solved > 0 for row in r.rows) > 1]
    most = sorted(compared, key=lambda r: (-r.problems, -sum(row.solved for row in r.rows)))[:PANELS]
    return [r for r in rankings if r in most]


def _panel(ranking: Ranking, rows: pd.DataFrame, compared: ComparedTimes) -> Panel | None:
    profile = compared.profile
    if not (len(compared.times.columns) and profile.compares):
        return None
    leading = profile.leading(NAMED)
    named = tuple(row.solver for row in ranking.rows if row.solver in leading)
    return Panel(ranking.formulation, profile, rows_of.label_kinds(rows), named)


def overview_figure(panels: Sequence[Panel], looks: Mapping[str, int]) -> Figure:
    """Draw the panels in rows, each with its own axis of τ and the legend of its named solvers below."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    across = min(ACROSS, len(panels))
    rows = -(-len(panels) // across)
    with matplotlib.rc_context({**STYLE, "font.size": 7.5}):
        figure = Figure(figsize=(WIDTH, rows * HIGH), dpi=150, layout="constrained")
        FigureCanvasAgg(figure)
        grid = figure.subplots(rows, across, squeeze=False)
        for axes in grid.flat[len(panels) :]:
            axes.remove()
        for axes, panel in zip(grid.flat, panels, strict=False):
            _draw(axes, panel, looks)
    return figure


def _draw(axes: Axes, panel: Panel, looks: Mapping[str, int]) -> None:
    """Draw the curves, and below them a line a named solver, the best first: its look, what it solved, its name."""
    from matplotlib.lines import Line2D

    upto = right_end(panel.profile)
    lines: dict[str, Line2D] = {}
    solved = {curve.label: curve.solved for curve in panel.profile.curves}
    for curve in sorted(panel.profile.curves, key=lambda c: (c.label in panel.named, c.label)):
        if not curve.solved:
            continue
        tau, height = curve.outline(upto, POINTS)
        place = looks[curve.label] if curve.label in panel.named else None
        look = legend.look(place, panel.kinds.get(curve.label, "") in INEXACT)
        look |= {} if place is None else {"markevery": (0, max(1, len(tau) // 4)), "markersize": 3, "linewidth": 1.4}
        (lines[curve.label],) = axes.plot(tau, height, drawstyle="steps-post", **look, zorder=2 if place is None else 4)
    frame(axes, upto, 6)
    axes.set_ylim(-TIGHT, 1.0 + TIGHT)
    axes.set_yticks([0.0, 0.5, 1.0])
    axes.set_xlabel("τ: time / fastest time", fontsize=6.8, labelpad=1.5)
    axes.set_title(f"{panel.name}  ({panel.profile.problems})", fontsize=8.5, loc="left", fontweight="bold", pad=3)
    names = [f"{solved[label]}  {marked(label, panel.kinds, 32)}" for label in panel.named]
    axes.legend(
        [lines[label] for label in panel.named], names, loc="upper left", bbox_to_anchor=(0.0, -0.28), fontsize=7.2,
        frameon=False, borderaxespad=0.0, labelspacing=0.3,
    )  # fmt: skip
