"""Time against size: every problem of a solver, with the power law that fits them.

A panel a solver, the leading ones; -p size=NAME names the dimension (default: the one that varies most). Problems
that were stopped at the limit are drawn as open triangles, and take no part in the fit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from cpbench.analysis import scaling
from cpbench.errors import CpbenchError, UnknownName
from cpbench.foundation.text import counted
from cpbench.report import canvas, figures
from cpbench.report.chosen import Choice, choose
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench.report.run import Run
from cpbench.report.text import cut, number, seconds

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANELS, ACROSS = 12, 4
"""The most panels, and how many stand in a row."""


@figure_kind("scaling", problem=Need.NONE, size="Dimension: n, m, nc, ... (default: the one that varies most).")
def draw(run: Run, choice: Choice, *, size: str = "") -> Drawing:
    """Draw panels of the solvers with most solved problems, by slope."""
    chosen = choose(run, choice)
    symbol = size or scaling.widest(chosen.rows)
    points = scaling.points(chosen.rows, symbol)
    if not len(points):
        dimensions = scaling.dimensions(chosen.rows)
        if size and size not in dimensions:
            raise UnknownName("dimension", size, dimensions)
        raise CpbenchError(
            f"nothing was solved or stopped at the limit that has a size {symbol or '(none is recorded)'}"
        )
    fitted = scaling.scaling(chosen.rows, symbol).sort_values(["solved", "label"], ascending=[False, True])
    shown = fitted[fitted["solved"] > 0].head(PANELS).sort_values(["slope", "label"])
    rows = max(1, -(-len(shown) // ACROSS))
    height = 1.5 * rows + 0.45
    figure = canvas.page(canvas.PAGE, height, constrained=True)
    grid = figure.subplots(rows, ACROSS, squeeze=False)
    low, top = float(points["seconds"].min()) / 2, float(points["seconds"].max()) * 2
    for axes in grid.flat[len(shown) :]:
        axes.remove()
    for k, (_, record) in enumerate(shown.iterrows()):
        axes: Axes = grid.flat[k]
        axes.set_xlim(float(points["x"].min()) / 1.3, float(points["x"].max()) * 1.3)
        axes.set_ylim(low, top)
        _panel(axes, points, record)
        if k % ACROSS:
            axes.tick_params(labelleft=False)
        if k + ACROSS < len(shown):
            axes.tick_params(labelbottom=False)
        else:
            axes.set_xlabel(symbol)
    figure.supylabel("time, log scale", fontsize=8)
    more = int((fitted["solved"] > 0).sum()) - len(shown)
    guide = (
        f"Each panel is a solver: a dot a problem it solved, a triangle one on which it was stopped at the limit, grey "
        f"dots those of all others. The line is the power law time ~ {symbol}^b by least squares over the dots, with b "
        "and its 95 % interval, problems taken as independent; where large problems are triangles, b is too small."
        + (f" Not shown: {counted(more, 'more solver')} that solved fewer." if more else "")
    )
    return chosen.drawing(figure, f"Time against {symbol}, {chosen.scope()}", guide)


def _panel(axes: Axes, points: pd.DataFrame, record: pd.Series[Any]) -> None:
    """Draw dots, triangles, line and slope of one solver."""
    axes.plot(points["x"], points["seconds"], linestyle="none", marker=".", markersize=2.5, color="#D4D4D4", zorder=1)
    own = points[points["label"] == record["label"]]
    done, stopped = own[~own["stopped"]], own[own["stopped"]]
    colour = figures.PALETTE[0]
    axes.plot(done["x"], done["seconds"], linestyle="none", marker="o", markersize=3.2, color=colour, zorder=3)
    open_look = {"markerfacecolor": "white", "markeredgecolor": figures.PALETTE[1], "markersize": 4.5}
    axes.plot(stopped["x"], stopped["seconds"], linestyle="none", marker="^", **open_look, zorder=3)
    figures.log_axis(axes, "x", number)
    figures.log_axis(axes, "y", seconds)
    slope_text = "no slope: " + ("few sizes" if "factor" in record["reason"] else "few solved")
    if not record["reason"]:
        axes.plot(*scaling.line(record), color=canvas.INK, linewidth=1.1, zorder=4)
        slope_text = f"b = {record['slope']:.2f} [{record['low']:.2f}, {record['high']:.2f}]"
    axes.set_title(cut(record["label"], 24), fontsize=7.5, loc="left", pad=12)
    axes.text(0.0, 1.03, slope_text, transform=axes.transAxes, fontsize=6.5, color="#444444", va="bottom")
    axes.tick_params(labelsize=6)
