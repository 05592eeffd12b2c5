"""A recorded sequence step by step: time, iterations, error, and what a warm start saves.

Needs steps of a sequence among the problems; with rows of --start previous and cold in one file (cpbench merge) a
fourth panel has the time of the warm start over that of the cold one.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from cpbench.analysis import steps as walk
from cpbench.analysis.starts import COLD
from cpbench.report import canvas, figures, legend, run_canvas
from cpbench.report.chosen import Choice, choose
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench.report.run import Run
from cpbench.report.text import counted, number, one_line, seconds

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SOLVERS = 4
"""The most solvers that are drawn: they would hide each other."""


@figure_kind("sequence", problem=Need.NONE, sequence="Name of the sequence, where there are several.")
def draw(run: Run, choice: Choice, *, sequence: str = "") -> Drawing:
    """Draw panels that share the steps; the solvers that solved most of them."""
    chosen = choose(run, choice, every_start=True)
    name, found = walk.steps(chosen.rows, sequence)
    solved = (
        found[found["time"] < math.inf].groupby("label").size().sort_index().sort_values(ascending=False, kind="stable")
    )
    shown = [str(label) for label in solved.index[:SOLVERS]]
    places = {label: chosen.looks[label] for label in shown}
    warm = found[found["label"].isin(shown) & (found["start"] != COLD)]
    panels = ["time", "iterations", "error"] + (["ratio"] if warm["ratio"].notna().any() else [])
    counted_ones = found.loc[found["label"].isin(shown), "iterations"].replace(math.inf, math.nan).notna().any()
    panels = [panel for panel in panels if panel != "iterations" or counted_ones]
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
    starts = sorted({str(start) for start in found["start"]} - {COLD})
    notes = [f"solid: start {', '.join(starts)}; dashed: cold"] if starts else []
    notes += ["gaps: not solved"]
    lines = [legend.LegendLine(figures.shorten(label, 24), str(int(solved[label])), places[label]) for label in shown]
    legend.beside(beside, "solved   at all starts", lines, notes)
    others = found["label"].nunique() - len(shown)
    fell = int(found["fell_back"].sum())
    guide = (
        f"Each mark is a step of the recorded sequence {name}, the same problem for all; a gap is a step that was not "
        "solved."
        + (
            " Lowest: the time of the warm start over the time of the cold one, below 1 it saves."
            if "ratio" in panels
            else ""
        )
        + (f" {counted(fell, 'warm start')} had nothing to start from and were cold." if fell else "")
        + (f" Not shown: {counted(others, 'more solver')}; --solver chooses." if others else "")
    )
    return run_canvas.drawn(
        figure,
        f"Sequence {name} ({chosen.node}): {counted(found['step'].nunique(), 'step')}, tolerance {chosen.tolerance:g}",
        guide,
        chosen,
    )


def _panel(axes: Axes, found: pd.DataFrame, column: str, places: dict[str, int], tolerance: float) -> None:
    """Draw one quantity of every solver over the steps."""
    for (label, start), own in found[found["label"].isin(list(places))].groupby(["label", "start"]):
        if column == "ratio" and start == COLD:
            continue
        cold = start == COLD and (found["start"] != COLD).any()
        values = own[column].where(np.isfinite(own[column]) & (own["time"] < math.inf))
        drawn = {**legend.look(places[str(label)], bool(cold)), "linewidth": 1.1, "markersize": 2.6}
        axes.plot(own["step"], values, **drawn, zorder=3 if cold else 4)
    if column == "iterations":
        figures.log_axis(axes, "y", number)
    elif column == "ratio":
        figures.log_axis(axes, "y", lambda value: f"{value:g}")
        axes.axhline(1.0, color=canvas.INK, linewidth=0.8)
    else:
        figures.log_axis(axes, "y", seconds if column == "time" else lambda value: f"{value:.0e}")
    if column == "error":
        axes.axhline(tolerance, color=canvas.INK, linewidth=0.8, linestyle=(0, (5, 3)))
    axes.set_ylabel({"ratio": "warm / cold", "error": "judged error"}.get(column, one_line(column)))
