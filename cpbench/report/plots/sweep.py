"""Solved and time against the value of one option of a solver, or against the facets ν of its route.

The labels of the results that differ in one option (`nsgs[omega=0.8]`, `nsgs[omega=1.2]`; `lemke@inner8`,
`lemke@inner16`) make a curve; --option names it where several change.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from cpbench.analysis.sweeps import FACETS, sweep
from cpbench.errors import CpbenchError
from cpbench.report import canvas, figures, legend, run_canvas
from cpbench.report.chosen import Choice, choose
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench.report.run import Run
from cpbench.report.text import counted, number, one_line, seconds

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@figure_kind("sweep", problem=Need.NONE, option="The option; facets for routes with facets.")
def draw(run: Run, choice: Choice, *, option: str = "") -> Drawing:
    """Draw two panels over the option's values: share of the problems solved, and mean time."""
    chosen = choose(run, choice)
    name, found = sweep(chosen.rows, option, chosen.problems)
    if not len(found):
        raise CpbenchError(f"--option {name}: no solver was run with two values of it")
    series = [str(label) for label in found.groupby("series")["solved"].max().sort_values(ascending=False).index]
    places = {label: place for place, label in enumerate(series[: legend.EMPHASISED])}
    word = "ν" if name == FACETS else one_line(name)
    height = max(2.6, legend.height(len(series), 0, run_canvas.LINES) + 0.3)
    figure = canvas.page(canvas.PAGE, height)
    boxes = [(x, 0.48 / height, 0.265, 1 - 0.6 / height) for x in (0.075, 0.42)]
    for box, column in zip(boxes, ("share", "mean"), strict=True):
        axes = figure.add_axes(box)
        for label in reversed(series):
            own = found[found["series"] == label]
            axes.plot(own["value"], own[column], **legend.look(places.get(label)), zorder=3)
        _dress(axes, found, column, word, chosen.problems)
    beside = figure.add_axes((0.71, 0.48 / height, 0.285, 1 - 0.6 / height))
    best = found.groupby("series")["solved"].max()
    lines = [legend.LegendLine(_between(label, 24), str(int(best[label])), places.get(label)) for label in series]
    legend.beside(beside, "most solved   solver", lines, most=run_canvas.LINES)
    guide = (
        f"Left: the fraction of the {counted(chosen.problems, 'problem')} that the solver solved with this value of "
        f"{word}. Right: its mean time (shifted geometric over all problems, a failure charged the limit); an end of a "
        "curve where it still falls says that the range was too narrow."
    )
    return run_canvas.drawn(figure, f"Sweep of {word}, {chosen.scope()}", guide, chosen)


def _between(label: str, length: int) -> str:
    """Shorten a label; names of a sweep often differ at their ends.

    >>> _between("casadi-ipopt-mlcp@innerν", 18)
    'casadi-ip…p@innerν'
    """
    half = length // 2
    return label if len(label) <= length else f"{label[: length - half]}…{label[len(label) - half + 1 :]}"


def _dress(axes: Axes, found: pd.DataFrame, column: str, word: str, problems: int) -> None:
    """Set scales and labels of a panel; values over more than a decade, all positive, are on a log scale."""
    least, most = float(found["value"].min()), float(found["value"].max())
    if word == "ν" or (least > 0 and most > 10 * least):
        figures.log_axis(axes, "x", number)
        values = sorted(set(found["value"]))
        if len(values) <= 8:
            axes.set_xticks(values)
    axes.set_xlabel(word)
    axes.grid(True, color="#E4E4E4", linewidth=0.6)
    axes.set_axisbelow(True)
    if column == "share":
        axes.set_ylim(0.0, 1.03)
        axes.set_ylabel(f"fraction of {counted(problems, 'problem')} solved")
    else:
        figures.log_axis(axes, "y", seconds)
        axes.set_ylabel("mean time")
