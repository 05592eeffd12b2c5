"""Active set: which of each complementary pair is zero in an answer, for lcp, mlcp, qp, ncp and micp.

Above: the pairs over their sizes, on logarithmic axes with zero at the tolerance. Below: the same by number.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cpbench.errors import CpbenchError, NotApplicable
from cpbench.formulations.base import Point, Problem
from cpbench.report import canvas
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench_lab.figures.active_sets import ActiveSide, Pairs, active_set

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = {
    ActiveSide.FIRST: canvas.BLUE,
    ActiveSide.SECOND: "#C9C9C9",
    ActiveSide.NEITHER: "#000000",
    ActiveSide.BOTH: canvas.RED,
    ActiveSide.NEGATIVE: canvas.RED,
}
FLOOR = 1e-3
"""Anything below this share of the tolerance is drawn on the axis."""


@figure_kind("active-set", answer=Need.REQUIRED, tolerance="Size, relative to the largest, up to which a number is 0.")
def draw(problem: Problem, point: Point, *, tolerance: float = 1e-6) -> Drawing:
    """Draw a column of two panels for each kind of pair."""
    if not 0 < tolerance < 1:
        raise CpbenchError(f"tolerance {tolerance:g}: is a share, between 0 and 1")
    found = active_set(problem, point, tolerance)
    if not found:
        raise NotApplicable("active-set", f"this {problem.node} has no inequality: nothing is complementary")
    count = len(found)
    figure = canvas.page(canvas.COLUMN if count == 1 else canvas.PAGE, 3.6 if count == 1 else 3.2)
    share = 1.0 / count
    for k, pairs in enumerate(found):
        left, wide = share * (k + (0.17 if count < 3 else 0.2)), share * 0.78
        _scatter(figure.add_axes((left, 0.30, wide, 0.67)), pairs, tolerance, 7.5 if count < 3 else 6.5)
        _strip(figure.add_axes((left, 0.115, wide, 0.06)), pairs)
    both = "; of ".join(f"{canvas.literal(p.first)} and {canvas.literal(p.second)}" for p in found)
    guide = (
        f"Each dot is a pair of {both}, over their largest sizes; up to {canvas.number(tolerance)} (grey lines) counts "
        "as zero, and what is below a thousandth of that is drawn on the edge. Strip: the pairs by number, blue where "
        "the first is positive, grey where the second is, black where both are zero, red where neither is, or one is "
        "negative."
    )
    return Drawing(figure, f"Active set: {canvas.literal(problem.name or problem.node)}", guide)


def _scatter(axes: Axes, pairs: Pairs, tolerance: float, size: float) -> None:
    from matplotlib.ticker import LogLocator, NullLocator

    floor = FLOOR * tolerance
    x, y = np.maximum(np.abs(pairs.x), floor), np.maximum(np.abs(pairs.y), floor)
    low, high = floor / 3.0, 8.0
    for axis in (axes.axhline, axes.axvline):
        axis(tolerance, color="#B5B5B5", linewidth=0.8, zorder=1)
    for side, colour in COLOURS.items():
        own = pairs.side == str(side)
        ink = "#8A8A8A" if side is ActiveSide.SECOND else colour
        marker = "x" if side in (ActiveSide.BOTH, ActiveSide.NEGATIVE) else "o"
        axes.scatter(x[own], y[own], s=11, color=ink, marker=marker, linewidths=0.9, zorder=3, clip_on=False)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(low, high)
    axes.set_ylim(low, high)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(10.0, numticks=5))
        axis.set_minor_locator(NullLocator())
    first, second = canvas.literal(pairs.first), canvas.literal(pairs.second)
    zero, rest = np.sqrt(low * tolerance), np.sqrt(high * tolerance)
    bad = pairs.count(ActiveSide.BOTH) + pairs.count(ActiveSide.NEGATIVE)
    for u, v, side_count, words, colour in (
        (rest, zero * 3, pairs.count(ActiveSide.FIRST), f"{first} > 0", canvas.BLUE),
        (zero * 1.2, rest, pairs.count(ActiveSide.SECOND), f"{second} > 0", "#5E5E5E"),
        (zero * 1.2, zero * 3, pairs.count(ActiveSide.NEITHER), "both 0", "#000000"),
        (rest, rest, bad, "neither 0", "#A34700"),
    ):
        axes.text(
            u, v, f"{side_count}\n{words}", color=colour, ha="center", va="center", fontsize=size, zorder=2,
            fontweight="bold" if side_count else "normal", alpha=1.0 if side_count else 0.55, bbox=canvas.PLATE,
        )  # fmt: skip
    axes.set_xlabel(f"{first}, over its size", labelpad=1)
    axes.set_ylabel(f"{second}, over its size", labelpad=1)


def _strip(axes: Axes, pairs: Pairs) -> None:
    from matplotlib.colors import to_rgb

    colours = {str(side): to_rgb(colour) for side, colour in COLOURS.items()}
    row = np.array([[colours[str(side)] for side in pairs.side]])
    axes.imshow(row, aspect="auto", interpolation="nearest", extent=(0.5, len(pairs.side) + 0.5, 0, 1))
    axes.set_yticks([])
    axes.set_xlabel("number of the pair", labelpad=0)
    axes.spines["left"].set_visible(False)
