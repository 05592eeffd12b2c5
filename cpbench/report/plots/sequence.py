"""A recorded sequence: what a warm start saves in each phase, or time, iterations and error step by step.

With rows of --start previous and cold in one file (--start cold,previous) it shows, for each solver, the median over
the steps of the time of the warm start over that of the cold one, in each phase of the sequence. Without both, every
step has a mark. Needs steps of a sequence among the problems.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from cpbench.analysis import phases
from cpbench.analysis import steps as walk
from cpbench.analysis.phases import Stretch
from cpbench.report import canvas, figures, legend, run_canvas
from cpbench.report.chosen import Choice, SelectedRows, choose
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench.report.run import Run
from cpbench.report.text import counted, number, one_line, seconds

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SOLVERS = 4
"""The most solvers whose steps are drawn: they would hide each other."""
ROWS = 8
"""The most solvers of which a phase has a row."""
MARKED = 50
"""The most steps that have a mark each."""
_ROW, _PHASE = 0.2, 0.34
"""Heights of a row and of the heading of a phase [in]."""


@figure_kind("sequence", problem=Need.NONE, sequence="Name of the sequence, where there are several.")
def draw(run: Run, choice: Choice, *, sequence: str = "") -> Drawing:
    """Draw the medians of warm over cold by phase where there are both, else panels that share the steps."""
    chosen = choose(run, choice, every_start=True)
    name, found = walk.steps(chosen.rows, sequence)
    warm = found[np.isfinite(found["ratio"])]
    return _phases(chosen, name, found, warm) if len(warm) else _steps(chosen, name, found)


def _phases(chosen: SelectedRows, name: str, found: pd.DataFrame, warm: pd.DataFrame) -> Drawing:
    """Draw a row for each solver in each phase: a mark at the median, a line from quartile to quartile."""
    parts = phases.phases(warm)
    medians = phases.medians(warm, parts)
    overall = warm.groupby("label")["ratio"].median().sort_values(kind="stable")
    shown = [str(label) for label in overall.index[:ROWS]]
    inside = len(parts) * (_PHASE + _ROW * len(shown))
    height = inside + 0.5
    figure = canvas.page(canvas.PAGE, height)
    axes = figure.add_axes((0.26, 0.42 / height, 0.66, inside / height))
    at, places, labels = 0.0, list[float](), list[str]()
    for k, part in enumerate(parts):
        steps = f"steps {part.first} to {part.last}{_contacts(chosen, name, part)}"
        middle: dict[str, Any] = {"xy": (0.0, at + _PHASE / 2), "xycoords": axes.get_yaxis_transform()}
        axes.annotate(steps, **middle, xytext=(-122, 0), textcoords="offset points", fontsize=7.5, va="center")
        at += _PHASE
        for label in shown:
            places.append(at + _ROW / 2)
            labels.append(figures.shorten(label, 28))
            own = medians[(medians["phase"] == k) & (medians["label"] == label)]
            if len(own):
                _row(axes, at + _ROW / 2, own.iloc[0], legend.colour(chosen.looks[label]))
            at += _ROW
    axes.set_ylim(at, 0.0)
    axes.set_yticks(places, labels)
    axes.tick_params(axis="y", length=0)
    axes.axvline(1.0, color=canvas.INK, linewidth=0.8)
    figures.log_axis(axes, "x", lambda value: f"{value:g}")
    axes.grid(False, axis="y")
    axes.set_xlabel("time warm / time cold")
    others, fell = overall.size - len(shown), int(found["fell_back"].sum())
    guide = (
        "A mark is the median over the steps of a phase that were solved from both starts; its line goes from quartile "
        "to quartile; left of 1 the warm start saves. A phase is a stretch of steps on which it saves about the same."
        + (f" {counted(fell, 'warm start')} had nothing to start from and were cold." if fell else "")
        + (f" Not shown: {counted(others, 'more solver')}; --solver chooses." if others else "")
    )
    return _drawn(figure, chosen, name, found, guide)


def _row(axes: Axes, at: float, row: pd.Series, colour: str) -> None:
    axes.plot([row["low"], row["high"]], [at, at], color=colour, linewidth=1.6, alpha=0.5, solid_capstyle="butt")
    axes.plot([row["median"]], [at], color=colour, marker="o", markersize=4.5, linestyle="none")
    text = f"{row['median']:.2g}"
    axes.text(1.02, at, text, transform=axes.get_yaxis_transform(), fontsize=8, va="center")


def _contacts(chosen: SelectedRows, name: str, part: Stretch) -> str:
    """Return how many contacts the steps of a phase have, where that is known."""
    from cpbench.analysis.sizes import sizes_of

    rows = chosen.rows
    counts = sizes_of(rows[(rows["sequence"] == name) & rows["step"].between(part.first, part.last)], "nc")
    counts = counts[np.isfinite(counts)]
    if not counts.size:
        return ""
    ends = dict.fromkeys((f"{counts.min():g}", f"{counts.max():g}"))
    return f" ({' to '.join(ends)} contacts)"


def _drawn(figure: Figure, chosen: SelectedRows, name: str, found: pd.DataFrame, guide: str) -> Drawing:
    steps = counted(found["step"].nunique(), "step")
    words = [f"Sequence {name} ({chosen.node}): {steps}", f"tolerance {chosen.tolerance:g}", chosen.starts]
    return run_canvas.drawn(figure, ", ".join(filter(None, words)), guide, chosen)


def _steps(chosen: SelectedRows, name: str, found: pd.DataFrame) -> Drawing:
    """Draw panels that share the steps; the solvers that solved most of them."""
    solved = (
        found[found["time"] < math.inf].groupby("label").size().sort_index().sort_values(ascending=False, kind="stable")
    )
    shown = [str(label) for label in solved.index[:SOLVERS]]
    places = {label: chosen.looks[label] for label in shown}
    counted_ones = found.loc[found["label"].isin(shown), "iterations"].replace(math.inf, math.nan).notna().any()
    panels = [panel for panel in ("time", "iterations", "error") if panel != "iterations" or counted_ones]
    height = 1.25 * len(panels) + 0.5
    figure = canvas.page(canvas.PAGE, height)
    for k, panel in enumerate(panels):
        box = (0.095, (0.45 + 1.25 * (len(panels) - 1 - k)) / height, 0.6, 1.12 / height)
        axes = figure.add_axes(box)
        _panel(axes, found, panel, places, chosen.tolerance)
        axes.set_xlim(float(found["step"].min()) - 0.5, float(found["step"].max()) + 0.5)
        if k < len(panels) - 1:
            axes.tick_params(labelbottom=False)
        else:
            axes.set_xlabel("step")
    beside = figure.add_axes((0.71, 0.45 / height, 0.285, (height - 0.55) / height))
    lines = [legend.LegendLine(figures.shorten(label, 24), str(int(solved[label])), places[label]) for label in shown]
    legend.beside(beside, "solved", lines, ["gaps: not solved"])
    others = found["label"].nunique() - len(shown)
    guide = (
        f"Each step of the recorded sequence {name} is the same problem for all; a gap is a step that was not solved."
        + (f" Not shown: {counted(others, 'more solver')}; --solver chooses." if others else "")
    )
    return _drawn(figure, chosen, name, found, guide)


def _panel(axes: Axes, found: pd.DataFrame, column: str, places: dict[str, int], tolerance: float) -> None:
    """Draw one quantity of every solver over the steps."""
    many = found["step"].nunique() > MARKED
    for (label, _), own in found[found["label"].isin(list(places))].groupby(["label", "start"]):
        values = own[column].where(np.isfinite(own[column]) & (own["time"] < math.inf))
        thin: dict[str, Any] = {"linewidth": 0.7, "marker": ""} if many else {"linewidth": 1.1, "markersize": 2.6}
        axes.plot(own["step"], values, **{**legend.look(places[str(label)]), **thin}, zorder=4)
    if column == "iterations":
        figures.log_axis(axes, "y", number)
    else:
        figures.log_axis(axes, "y", seconds if column == "time" else lambda value: f"{value:.0e}")
    if column == "error":
        axes.axhline(tolerance, color=canvas.INK, linewidth=0.8, linestyle=(0, (5, 3)))
    axes.set_ylabel({"error": "judged error"}.get(column, one_line(column)))
