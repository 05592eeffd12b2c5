"""Work-precision: the median time to each error over a group of problems, from recorded iterates.

Needs a run with --history, which keeps the iterates of solvers that can tell them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import pandas as pd

from cpbench.analysis import histories
from cpbench.errors import CpbenchError
from cpbench.report import figures
from cpbench.report.chosen import Choice, SelectedRows, choose
from cpbench.report.figure_kinds import Drawing, figure_kind
from cpbench.report.run import Run
from cpbench.report.text import cut, listed_plainly, seconds

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@figure_kind("precision")
def draw(run: Run, choice: Choice) -> Drawing:
    """Draw one curve a solver with histories, the one that gets furthest in the first colour."""
    chosen = choose(run, choice)
    require_histories(chosen)
    curves = histories.work_precision(chosen.rows, chosen.histories)
    figure, axes = figures.with_room(curves["label"].nunique(), notes=1)
    _curves(axes, curves, chosen.problems, chosen.line_styles)
    axes.set_xlabel("time, conversion and set-up included, log scale")
    without = sorted(set(chosen.rows["label"]) - set(curves["label"]))
    left_out = f" No history of {listed_plainly(without)}." if without else ""
    return chosen.drawing(figure, f"Error against time, {chosen.scope()}", guide_of(chosen.problems) + left_out)


def require_histories(chosen: SelectedRows) -> None:
    """Raise CpbenchError when no iterate of these rows was kept."""
    if not chosen.rows["key"].isin(chosen.histories["key"]).any():
        raise CpbenchError("no iterates were kept of these rows: run with --history, for solvers that tell theirs")


def guide_of(problems: int) -> str:
    """Return how to read the figure."""
    if problems == 1:
        return (
            "A curve shows the error, as cpbench judges it, of the best iterate that the solver had after that time. "
            "Iterates are kept at growing intervals, so that a time is an upper bound."
        )
    return (
        f"A curve passes ε at the median, over the {problems} problems, of the times to the first iterate whose error, "
        "as cpbench judges it, was at most ε; it ends where fewer than half of the problems got further. Iterates are "
        "kept at growing intervals, so that a time is an upper bound."
    )


def _curves(axes: Axes, points: pd.DataFrame, problems: int, styles: Mapping[str, int]) -> None:
    """Draw curves of `analysis.histories.work_precision` with their legend beside them, lowest end first."""
    curves: dict[str, pd.DataFrame] = {
        str(label): curve[curve["seconds"] < math.inf] for label, curve in points.groupby("label", sort=True)
    }
    drawn = sorted(
        (label for label, curve in curves.items() if len(curve)),
        key=lambda label: (float(curves[label]["error"].min()), float(curves[label]["seconds"].max()), label),
    )
    lines: list[figures.Line] = []
    for k, label in enumerate(drawn):
        curve, style = curves[label], styles[label] if k < figures.EMPHASISED else None
        words = cut(label, figures.LABEL_LENGTH), f"{curve['error'].min():.0e}"
        lines.append(figures.Line(*words, curve["seconds"], curve["error"], style))
    figures.draw_lines(axes, lines)
    dress(axes)
    axes.set_ylabel("judged error" if problems == 1 else "judged error, on half of the problems")
    if not drawn:
        figures.nothing(axes, "no error was reached on half of the problems")
    figures.legend_beside(axes, "least error   lowest end first", lines)


def dress(axes: Axes) -> None:
    """Set scales, ticks and grid of errors against times."""
    figures.log_axis(axes, "x", seconds)
    figures.log_axis(axes, "y", lambda value: f"{value:.0e}")
    axes.set_xlabel("time, log scale; conversion, set-up and carrying back included")
