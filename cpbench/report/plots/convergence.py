"""Convergence on one problem: the error of every kept iterate, as cpbench judges it, against time.

Needs a run with --history; -p name=NAME names the problem where there are several, -p reported=true adds what
the solver says of its own iterates.
"""

from __future__ import annotations

import math

import pandas as pd

from cpbench.analysis import histories
from cpbench.analysis import table as rows_of
from cpbench.errors import CpbenchError
from cpbench.report import canvas, figures, legend, run_canvas
from cpbench.report.chosen import Choice, choose, matching
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench.report.plots.precision import dress, require_histories
from cpbench.report.run import Run
from cpbench.report.text import counted, cut, one_line

FLOOR = 1e-17
"""Errors of 0 are drawn here."""


@figure_kind(
    "convergence",
    problem=Need.NONE,
    name="Problem, where there are several: its name, or a pattern with * and ? of one.",
    reported="Add, dotted, the residual that the solver itself reported for each iterate.",
)
def draw(run: Run, choice: Choice, *, name: str = "", reported: bool = False) -> Drawing:
    """Draw one curve a solver with a history of the problem."""
    chosen = choose(run, choice)
    require_histories(chosen)
    own, problem = _of_one(chosen.rows, chosen.histories, name)
    iterates = histories.charged(own, chosen.histories)
    iterates = iterates[iterates["error"] < math.inf]
    paths = {str(label): path for label, path in iterates.groupby("label")}
    ends = sorted(paths, key=lambda label: (float(paths[label]["error"].min()), label))
    places = {label: chosen.looks[label] for label in ends[: legend.EMPHASISED]}
    figure, axes = run_canvas.with_legend(len(ends), notes=2)
    for label in reversed(ends):
        path, place = paths[label], places.get(label)
        marks = {} if place is None else {"markevery": max(1, len(path) // 8)}
        axes.plot(path["seconds"], path["error"].clip(lower=FLOOR), **legend.look(place), **marks, zorder=3)
        if reported and place is not None:
            colour = legend.colour(place)
            axes.plot(path["seconds"], path["residual"].clip(lower=FLOOR), color=colour, linewidth=0.9, linestyle=":")
    axes.axhline(chosen.tolerance, color=canvas.INK, linewidth=0.8, linestyle=(0, (5, 3)), zorder=2)
    dress(axes)
    axes.set_xlabel("time, conversion and set-up included, log scale")
    axes.set_ylabel("judged error of the iterate")
    lines = [
        legend.LegendLine(figures.shorten(label), f"{paths[label]['error'].min():.0e}", places.get(label))
        for label in ends
    ]
    legend.beside(axes, "least error   lowest first", lines, ["dashed: the tolerance"], run_canvas.LINES)
    guide = (
        f"Each mark and corner is an iterate of a solve of {problem}: its time, and its error as cpbench judges it "
        "on the original problem; iterates are kept at growing intervals, so that a time is an upper bound."
        + (" Dotted: the solver's own residual, on its own scale." if reported else "")
    )
    title = f"Convergence on {cut(problem, 40)} ({one_line(chosen.node)}), {counted(len(ends), 'solver')}"
    return run_canvas.drawn(figure, f"{title}, tolerance {chosen.tolerance:g}", guide, chosen)


def _of_one(rows: pd.DataFrame, paths: pd.DataFrame, name: str) -> tuple[pd.DataFrame, str]:
    """Return the rows of one problem: the only one with histories, or the only one of that name."""
    recorded = rows[rows["key"].isin(paths["key"])]
    names = rows_of.problem_names(recorded)
    known = sorted({str(known) for known in names})
    matched = sorted(matching(set(known), [name], "problem with iterates")) if name else known
    if len(matched) > 1:
        shown = ", ".join(matched[:12]) + (", ..." if len(matched) > 12 else "")
        which = f"{name} names {len(matched)} problems" if name else f"iterates were kept of {len(matched)} problems"
        raise CpbenchError(f"{which}: name one with --name: {shown}")
    return recorded[names == matched[0]], matched[0]
