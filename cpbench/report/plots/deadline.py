"""Deadlines: how late each solver may be, and how often it misses --deadline.

The times that half, 95 %, 99 % and all of the problems were solved within, failures being never; the share of misses,
with the longest run of misses within a recorded sequence.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from cpbench.analysis import deadlines
from cpbench.errors import CpbenchError
from cpbench.foundation.plurals import counted
from cpbench.report import canvas, figures, legend, run_canvas
from cpbench.report.chosen import Choice, choose
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench.report.run import Run
from cpbench.report.text import one_line, seconds

SOLVERS = 24
QUANTILES = {"p50": "half", "p95": "95 %", "p99": "99 %", "max": "all"}
MARKS: dict[str, dict[str, Any]] = {
    "p50": {"marker": "o", "markersize": 4.6, "color": legend.PALETTE[0]},
    "p95": {"marker": "s", "markersize": 4.6, "color": legend.PALETTE[1]},
    "p99": {"marker": "D", "markersize": 4.2, "color": legend.PALETTE[2]},
    "max": {"marker": "o", "markersize": 8.0, "markerfacecolor": "none", "markeredgecolor": "#555555"},
}


@figure_kind("deadline", problem=Need.NONE, deadline="The deadline: 1ms, 0.5s.")
def draw(run: Run, choice: Choice, *, deadline: float = math.nan) -> Drawing:
    """Draw a line a solver, the one with the fewest misses on top."""
    if not deadline > 0 or math.isinf(deadline):
        raise CpbenchError("--deadline is missing: give a time that counts, as --deadline 1ms")
    chosen = choose(run, choice)
    late = deadlines.deadlines(chosen.rows, deadline)
    order = late.sort_values(["misses", "p95", "p50", "label"], ignore_index=True)
    shown = order[order["solved"] > 0].head(SOLVERS)
    height = 0.21 * max(4, len(shown)) + 0.95
    figure = canvas.page(canvas.PAGE, height)
    axes = figure.add_axes((0.27, 0.45 / height, 0.44, (height - 0.95) / height))
    finite = shown[list(QUANTILES)].to_numpy(dtype=float)
    finite = [*finite[np.isfinite(finite)], deadline]
    low, high = min(finite) / 1.6, max(finite) * 1.6
    never = high * (high / low) ** 0.05
    axes.set_xlim(low, high * (high / low) ** 0.1)
    figures.log_axis(axes, "x", seconds, high)
    axes.axvspan(high, high * (high / low) ** 0.1, color="#EDEDED", linewidth=0)
    axes.axvline(deadline, color=canvas.INK, linewidth=1.0, linestyle=(0, (5, 3)), zorder=2)
    for y, (_, row) in enumerate(shown.iterrows()):
        times = [min(float(row[name]), never) for name in QUANTILES]
        axes.plot([times[0], times[-1]], [y, y], color="#B8B8B8", linewidth=1.3, zorder=3)
        for k, name in enumerate(QUANTILES):
            if times[k] < never or not k or times[k - 1] < never:  # of marks at never the first tells all
                axes.plot(times[k], y, **MARKS[name], linestyle="none", zorder=5 - k / 10)
        name = figures.marked(one_line(row["label"]), chosen.kinds, 28)
        misses = f"{row['share']:.0%} [{row['low']:.0%}, {row['high']:.0%}]"
        across = axes.get_yaxis_transform()
        axes.text(-0.02, y, name, transform=across, ha="right", va="center", fontsize=7.5)
        axes.text(1.36, y, misses, transform=across, ha="right", va="center", fontsize=7.5)
        axes.text(1.55, y, str(int(row["longest"])), transform=across, ha="right", va="center", fontsize=7.5)
    axes.set_ylim(len(shown) - 0.4, -0.6)
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    axes.set_xlabel("time, log scale; grey band: not solved within the limit")
    heads = ((1.36, "missed", "right"), (1.55, "in a row", "right"))
    for x, text, side in heads:
        axes.text(x, 1 + 0.1 / height, text, transform=axes.transAxes, fontsize=7, ha=side, va="bottom")
    for k, (name, text) in enumerate(QUANTILES.items()):
        x, y = 0.02 + 0.22 * k, 1 + 0.2 / (height - 0.95)
        axes.plot([x], [y], **MARKS[name], linestyle="none", transform=axes.transAxes, clip_on=False)
        axes.text(x + 0.035, y, text, transform=axes.transAxes, fontsize=7.5, va="center")
    rest = len(order) - len(shown)
    guide = (
        "Marks: the times within which half, 95 %, 99 % and all of the problems were solved; what was not solved is "
        f"never there. Dashed: the deadline of {seconds(deadline)}; missed is the share of problems not solved by "
        "then, with Wilson's 95 % interval, which takes them for independent; in a row: most consecutive misses in a "
        "recorded sequence."
    )
    guide += f" Not shown: {counted(rest, 'solver')} that missed more or solved none." if rest else ""
    return run_canvas.drawn(figure, f"Deadline of {seconds(deadline)}, {chosen.scope()}", guide, chosen)
