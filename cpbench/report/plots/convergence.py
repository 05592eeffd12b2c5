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
from cpbench.report import canvas, figures
from cpbench.report.chosen import Choice, choose, matching
from cpbench.report.figure_kinds import Drawing, figure_kind
from cpbench.report.run import Run
from cpbench.report.text import counted, cut, one_line, seconds

FLOOR = 1e-17
"""Errors of 0 are drawn here."""


@figure_kind(
    "convergence",
    name="Problem, where there are several: its name, or a pattern with * and ? of one.",
    reported="Add, dotted, the residual that the solver itself reported for each iterate.",
)
def draw(run: Run, choice: Choice, *, name: str = "", reported: bool = False) -> Drawing:
    """Draw one curve a solver with a history of the problem."""
    chosen = choose(run, choice)
    if not chosen.rows["key"].isin(chosen.histories["key"]).any():
        raise CpbenchError("no iterates were kept of these rows: run with --history, for solvers that tell theirs")
    solves, problem = _of_one(chosen.rows, chosen.histories, name)
    iterates = histories.charged(solves, chosen.histories)
    iterates = iterates[iterates["error"] < math.inf]
    paths = {str(label): path for label, path in iterates.groupby("label")}
    ends = sorted(paths, key=lambda label: (float(paths[label]["error"].min()), label))
    lines: list[figures.Line] = []
    figure, axes = figures.with_room(len(ends), notes=2)
    for k, label in enumerate(ends):
        path, style = paths[label], chosen.line_styles[label] if k < figures.EMPHASISED else None
        corners = path["seconds"], path["error"].clip(lower=FLOOR)
        lines.append(figures.Line(cut(label, figures.LABEL_LENGTH), f"{path['error'].min():.0e}", *corners, style))
        if reported and style is not None:
            colour = figures.colour(style)
            axes.plot(path["seconds"], path["residual"].clip(lower=FLOOR), color=colour, linewidth=0.9, linestyle=":")
    figures.draw_lines(axes, lines, steps=False)
    axes.axhline(chosen.tolerance, color=canvas.INK, linewidth=0.8, linestyle=(0, (5, 3)), zorder=2)
    figures.log_axis(axes, "x", seconds)
    figures.log_axis(axes, "y", lambda value: f"{value:.0e}")
    axes.set_xlabel("time, conversion and set-up included, log scale")
    axes.set_ylabel("judged error of the iterate")
    figures.legend_beside(axes, "least error   lowest first", lines, ["dashed: the tolerance"])
    guide = (
        f"Each mark and corner is an iterate of a solve of {problem}: its time, and its error as cpbench judges it "
        "on the original problem; iterates are kept at growing intervals, so that a time is an upper bound."
        + (" Dotted: the solver's own residual, on its own scale." if reported else "")
    )
    title = f"Convergence on {cut(problem, 40)} ({one_line(chosen.node)}), {counted(len(ends), 'solver')}"
    return chosen.drawing(figure, f"{title}, tolerance {chosen.tolerance:g}", guide)


def _of_one(rows: pd.DataFrame, paths: pd.DataFrame, name: str) -> tuple[pd.DataFrame, str]:
    """Return the rows of one problem: the only one with histories, or the only one of that name."""
    recorded = rows[rows["key"].isin(paths["key"])]
    names = rows_of.problem_names(recorded)
    problems = sorted({str(problem) for problem in names})
    matched = sorted(matching(set(problems), [name], "problem with iterates")) if name else problems
    if len(matched) > 1:
        shown = ", ".join(matched[:12]) + (", ..." if len(matched) > 12 else "")
        which = f"{name} names {len(matched)} problems" if name else f"iterates were kept of {len(matched)} problems"
        raise CpbenchError(f"{which}: name one with --name: {shown}")
    return recorded[names == matched[0]], matched[0]
