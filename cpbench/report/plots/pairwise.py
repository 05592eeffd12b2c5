"""Two solvers against each other: the cost of every problem for both, and how often each is ahead.

--against A,B names them; without it, the two with the largest areas under the profile.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from cpbench.analysis import pairwise
from cpbench.analysis.metrics import Metric
from cpbench.errors import CpbenchError
from cpbench.report import canvas, figures, legend, run_canvas
from cpbench.report.chosen import Choice, choose, leading, two_labels
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench.report.run import Run
from cpbench.report.text import counted, one_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RATIOS = (10.0, 100.0)
"""Lines beside the diagonal: so many times dearer."""


@figure_kind(
    "pairwise",
    problem=Need.NONE,
    metric="Cost: time, solve, cpu, memory, iterations, counter:NAME.",
    against="The two solvers, as A,B.",
)
def draw(run: Run, choice: Choice, *, metric: str = "time", against: str = "") -> Drawing:
    """Draw a point a problem; a problem that one of the two did not solve lies in its band beyond the largest cost."""
    chosen = choose(run, choice)
    found, left_out = chosen.measured(metric)
    known = [str(label) for label in found.values.columns]
    names = two_labels(against, known) if against else tuple(leading(chosen, found.values, 2))
    if len(names) < 2:
        raise CpbenchError(f"two solvers are needed that solve something; shown are {len(names)}")
    one, other = names
    wins, losses, ties = pairwise.record(found.values, one, other, found.metric.floor)
    both = found.values[[one, other]].clip(lower=found.metric.floor or 0.0)
    figure = canvas.page(4.6, 4.1, constrained=True)
    axes = figure.subplots()
    _scatter(axes, both, one, other, found.metric)
    cost = run_canvas.word(found.metric)
    guide = (
        f"A point is a problem: its {cost} with {one} across, with {other} upwards; above the solid line {one} is "
        f"ahead, dotted: {' and '.join(f'{r:g}' for r in RATIOS)} times. In the grey bands: not solved by that one. "
        f"{one} is ahead on {wins}, {other} on {losses}; {ties} alike; "
        f"{counted(chosen.problems - wins - losses - ties, 'problem')} solved by neither.{left_out}"
    )
    return run_canvas.drawn(figure, f"{one} against {other}, {chosen.scope()}", guide, chosen)


def _scatter(axes: Axes, both: pd.DataFrame, one: str, other: str, metric: Metric) -> None:
    values = both.to_numpy(dtype=float)
    done = values[np.isfinite(values)]
    room = 4.0 if len(done) and done.max() < 10 * done.min() else 1.6
    low, high = (float(done.min()) / room, float(done.max()) * room) if len(done) else (1.0, 10.0)
    span = (high / low) ** 0.1
    lost = math.sqrt(span) * high
    axes.set_xlim(low, high * span)
    axes.set_ylim(low, high * span)
    figures.log_axis(axes, "x", lambda value: run_canvas.amount(value, metric), high)
    figures.log_axis(axes, "y", lambda value: run_canvas.amount(value, metric), high)
    for band in (axes.axhspan, axes.axvspan):
        band(high, high * span, color="#EDEDED", linewidth=0, zorder=0)
    axes.plot([low, high], [low, high], color=canvas.INK, linewidth=0.9, zorder=2)
    for ratio in RATIOS:
        axes.plot([low, high / ratio], [low * ratio, high], color=canvas.GREY, linewidth=0.8, linestyle=":", zorder=1)
        axes.plot([low * ratio, high], [low, high / ratio], color=canvas.GREY, linewidth=0.8, linestyle=":", zorder=1)
    drawn = values[np.isfinite(values).any(axis=1)]
    x, y = np.where(np.isfinite(drawn), drawn, lost).T
    ahead, behind = x < y, x > y
    look = {"linestyle": "none", "markersize": 5, "markeredgewidth": 0.8, "zorder": 4}
    axes.plot(x[ahead], y[ahead], marker="o", color=legend.PALETTE[0], **look)
    axes.plot(x[behind], y[behind], marker="s", markerfacecolor="none", color=legend.PALETTE[1], **look)
    alike = ~(ahead | behind)
    axes.plot(x[alike], y[alike], marker="D", markerfacecolor="none", color=canvas.GREY, **look)
    cost = run_canvas.word(metric)
    axes.set_xlabel(f"{cost}, {figures.shorten(one_line(one))}")
    axes.set_ylabel(f"{cost}, {figures.shorten(one_line(other))}")
    look = {"fontsize": 7, "color": "#555555", "ha": "center", "va": "center"}
    axes.text(lost, _clear(y[x == lost], low, high), "not solved", rotation=90, **look)
    axes.text(_clear(x[y == lost], low, high), lost, "not solved", **look)


def _clear(taken: np.ndarray, low: float, high: float) -> float:
    """Return a place in a band, on its log scale, that is farthest from the points in it; the middle where all are
    alike.
    """
    places = low * (high / low) ** np.linspace(0.15, 0.85, 15)
    apart = np.abs(np.log(places[:, None] / taken)).min(axis=1, initial=math.inf)
    best = places[apart >= apart.max() - 1e-12]
    return float(best[len(best) // 2])
