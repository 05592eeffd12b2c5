"""Error against time of a group whose solves were recorded, as a figure and a table."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import pandas as pd

from cpbench.analysis import histories
from cpbench.report import figures
from cpbench.report.text import code, counted, plain, seconds, table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from cpbench.report.run import Run

DECADES = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)
"""Errors that the table has columns for."""


def guide(problems: int) -> str:
    """How to read the figure."""
    if problems == 1:
        return (
            "A curve shows the error, as we judge it, of the best iterate that the solver had after that time. "
            "Iterates are kept at growing intervals, so that a time is an upper bound."
        )
    return (
        f"A curve passes ε at the median, over the {problems} problems, of the times to the first iterate whose error, "
        "as we judge it, was at most ε; it ends where fewer than half of the problems got further. Iterates are kept "
        "at growing intervals, so that a time is an upper bound."
    )


def section(run: Run, rows: pd.DataFrame, title: str, name: str) -> Iterator[str]:
    """The figure, saved under `name`, and the table; nothing for a group without histories."""
    found = histories.work_precision(rows, run.histories)
    if not len(found):
        return
    problems = int(rows["fingerprint"].nunique())
    yield "### Error against time"
    figures.save(figure(found, problems, title), run.folder, name)
    yield f"[![Error against time, {plain(title)}]({name}.png)]({name}.svg)"
    yield f"*{guide(problems)}*"
    wanted = [e for e in DECADES if (found["error"] <= e).any()]
    yield table(
        ["solver", *(f"to {e:g}" for e in wanted)],
        ([code(label), *(_cell(own, e, problems) for e in wanted)] for label, own in found.groupby("label")),
        right=range(1, 1 + len(wanted)),
    )
    yield (
        f"Median time over {counted(problems, 'problem')}, ∞ where more than half were not reached; in brackets how "
        "many were, where not all. Solvers that keep no history are not here."
    )


def figure(found: pd.DataFrame, problems: int, title: str) -> Figure:
    """Work-precision curves, as `analysis.histories.work_precision` gives them, legend in the order of their ends."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    curves: dict[str, pd.DataFrame] = {
        str(label): own[own["seconds"] < math.inf] for label, own in found.groupby("label", sort=True)
    }
    drawn = sorted(
        (label for label, own in curves.items() if len(own)),
        key=lambda label: (float(curves[label]["error"].min()), float(curves[label]["seconds"].max()), label),
    )
    places = {label: place for place, label in enumerate(drawn[: figures.EMPHASISED])}
    with matplotlib.rc_context(figures.STYLE):
        height = max(4.2, 1.5 + figures.LINE * (min(len(drawn), figures.LEGEND_LINES) + 2))
        made = Figure(figsize=(9.2, height), dpi=150)
        FigureCanvasAgg(made)
        bottom = 1.0 / height
        box = (bottom, 0.99 - bottom - 0.42 / height)
        axes = made.add_axes((0.09, box[0], 0.535, box[1]))
        beside = made.add_axes((0.685, box[0], 0.31, box[1]))
        made.text(0.09, 1 - 0.24 / height, title, fontsize=10.5, fontweight="bold", va="center")
        for label in reversed(drawn):
            own = curves[label]
            axes.plot(own["seconds"], own["error"], drawstyle="steps-post", **_look(places.get(label)), zorder=3)
        _dress(axes)
        axes.set_ylabel("judged error" if problems == 1 else "judged error, on half of the problems")
        if not drawn:
            axes.text(0.5, 0.5, "no error was reached on half of the problems", transform=axes.transAxes, ha="center")
        _legend(beside, drawn, places, curves)
        text = textwrap.fill(guide(problems), 136)
        made.text(0.065, 0.10 / height, text, fontsize=7.8, color="#444444", va="bottom", linespacing=1.35)
    return made


def _dress(axes: Axes) -> None:
    """Scales, ticks and grid."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    axes.set_xscale("log")
    axes.set_yscale("log")
    low, high = axes.get_xlim()
    few = high < 100 * low  # decades alone would be one tick or none
    axes.xaxis.set_major_locator(LogLocator(10.0, subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: seconds(value)))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.0e}"))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.grid(True, color="#E4E4E4", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_xlabel("time, log scale; conversion, set-up and carrying back included")


def _look(place: int | None) -> dict[str, Any]:
    if place is None:
        return {"color": figures.GREY, "linewidth": 0.9}
    look = {"color": figures.PALETTE[place], "marker": figures.MARKERS[place], "markevery": 8}
    return {**look, "linewidth": 1.7, "markersize": 4.2}


def _legend(axes: Axes, drawn: list[str], places: Mapping[str, int], curves: Mapping[str, pd.DataFrame]) -> None:
    """One line a curve with its least error, in the order of the ends."""
    axes.set_axis_off()
    lines = axes.figure.get_figheight() * axes.get_position().height / figures.LINE  # type: ignore[union-attr]
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(lines, 0.0)
    axes.text(0.0, 0.0, "least error   lowest end first", fontsize=7.8, color="#444444", va="center")
    for line, label in enumerate(drawn[: figures.LEGEND_LINES], start=1):
        look = {**_look(places.get(label)), "markevery": [1]}
        axes.plot([0.17, 0.215, 0.26], [line, line, line], **look)
        axes.text(0.14, line, f"{curves[label]['error'].min():.0e}", fontsize=8, va="center", ha="right")
        axes.text(0.29, line, figures.shorten(label), fontsize=8, va="center")
    if len(drawn) > figures.LEGEND_LINES:
        more = f"and {len(drawn) - figures.LEGEND_LINES} more in grey"
        axes.text(0.0, figures.LEGEND_LINES + 1.2, more, fontsize=7.2, color="#666666", va="center")


def _cell(own: pd.DataFrame, error: float, problems: int) -> str:
    """Median time to an error of one label, with the number of problems where that is not all."""
    there = own[own["error"] <= error]
    if not len(there):
        return "—"
    first = there.iloc[0]
    reached = int(first["reached"])
    time = seconds(float(first["seconds"])) if first["seconds"] < math.inf else "∞"
    return time if reached == problems else f"{time} ({reached})"
