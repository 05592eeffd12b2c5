"""Error against time of a group whose solves were recorded, as a figure and a table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import pandas as pd

from cpbench.analysis import histories
from cpbench.report import figures, legend
from cpbench.report.text import code, counted, plain, seconds, table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from cpbench.report.run import Run

DECADES = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)
"""Errors that the table has columns for."""


def guide(problems: int) -> str:
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


def section(run: Run, rows: pd.DataFrame, title: str, name: str) -> Iterator[str]:
    """Yield the figure, saved under `name`, and the table; nothing for a group without histories."""
    work_precision = histories.work_precision(rows, run.histories)
    if not len(work_precision):
        return
    problems = int(rows["fingerprint"].nunique())
    yield "### Error against time"
    figures.save(figure(work_precision, problems, title, run.looks), run.folder, name)
    yield f"[![Error against time, {plain(title)}]({name}.png)]({name}.svg)"
    yield f"*{guide(problems)}*"
    head, lines = times_table(work_precision, problems)
    yield table(head, ([code(label), *cells] for label, *cells in lines), right=range(1, len(head)))
    yield (
        f"Median time over {counted(problems, 'problem')}, ∞ where more than half were not reached; in brackets how "
        "many were, where not all. Solvers that keep no history are not here."
    )


def times_table(found: pd.DataFrame, problems: int) -> tuple[list[str], list[list[str]]]:
    """Return head and rows of the median times to some errors, as text, from `analysis.histories.work_precision`."""
    wanted = [e for e in DECADES if (found["error"] <= e).any()]
    rows = [[str(label), *(_cell(own, e, problems) for e in wanted)] for label, own in found.groupby("label")]
    return ["solver", *(f"to {e:g}" for e in wanted)], rows


def figure(found: pd.DataFrame, problems: int, title: str, looks: Mapping[str, int]) -> Figure:
    """Draw work-precision curves, as `analysis.histories.work_precision` gives them, legend in the order of their
    ends.
    """
    import matplotlib

    drawn = sum(1 for _, own in found.groupby("label") if (own["seconds"] < math.inf).any())
    with matplotlib.rc_context(figures.STYLE):
        height = max(4.2, 1.5 + legend.LINE * (min(drawn, legend.LINES) + 2))
        drawing, axes = figures.sheet(height, title, guide(problems))
        curves_axes(axes, found, problems, looks)
    return drawing


def curves_axes(axes: Axes, found: pd.DataFrame, problems: int, looks: Mapping[str, int]) -> None:
    """Draw curves of `analysis.histories.work_precision` with their legend beside them, lowest end first."""
    curves: dict[str, pd.DataFrame] = {
        str(label): own[own["seconds"] < math.inf] for label, own in found.groupby("label", sort=True)
    }
    drawn = sorted(
        (label for label, own in curves.items() if len(own)),
        key=lambda label: (float(curves[label]["error"].min()), float(curves[label]["seconds"].max()), label),
    )
    places = {label: looks[label] for label in drawn[: legend.EMPHASISED]}
    for label in reversed(drawn):
        own, place = curves[label], places.get(label)
        marks: dict[str, Any] = {} if place is None else {"markevery": 8}
        axes.plot(own["seconds"], own["error"], drawstyle="steps-post", **legend.look(place), **marks, zorder=3)
    dress(axes)
    axes.set_ylabel("judged error" if problems == 1 else "judged error, on half of the problems")
    if not drawn:
        figures.nothing(axes, "no error was reached on half of the problems")
    lines = [
        legend.LegendLine(figures.shorten(label), f"{curves[label]['error'].min():.0e}", places.get(label))
        for label in drawn
    ]
    legend.beside(axes, "least error   lowest end first", lines)


def dress(axes: Axes) -> None:
    """Set scales, ticks and grid of errors against times."""
    figures.log_axis(axes, "x", seconds)
    figures.log_axis(axes, "y", lambda value: f"{value:.0e}")
    axes.set_xlabel("time, log scale; conversion, set-up and carrying back included")


def _cell(own: pd.DataFrame, error: float, problems: int) -> str:
    """Format the median time to an error of one label, with the number of problems where that is not all."""
    there = own[own["error"] <= error]
    if not len(there):
        return "—"
    first = there.iloc[0]
    reached = int(first["reached"])
    time = seconds(float(first["seconds"])) if first["seconds"] < math.inf else "∞"
    return time if reached == problems else f"{time} ({reached})"
