"""A profile with a panel a solver, for any number of them.

All panels are drawn into one axes whose coordinates are inches: a figure of a hundred panels then has a dozen artists
and not a hundred axes with their scales, ticks and spines, and takes a tenth of the time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cpbench.analysis.profiles import Curve, Profile, thinned
from cpbench.report import legend
from cpbench.report.figures import INEXACT, STYLE, marked, power_text, powers, right_end

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from cpbench.analysis.table import Floats

ACROSS = 4
"""Panels a row."""
POINTS = 400
"""The most corners of a curve, so that none is off by more than this part of its panel's height."""
WIDTH, LEFT, RIGHT, ABOVE, BELOW = 9.2, 0.41, 0.09, 0.6, 0.47
"""Width and margins of the figure [in]."""
HIGH, BETWEEN = 1.08, 0.37
"""Height of a panel, and the space to the next below [in]."""
WIDE, BESIDE = 2.02, 0.205
"""Width of a panel, and the space to the next beside it [in]."""
TICKS, HEIGHTS = 5, (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
"""About how many powers of two stand below a panel, and the fractions beside it."""
TICK = 3.5 / 72
"""Length of a tick [in]."""
SMALL = 7.5


@dataclass(frozen=True)
class ProfilePanel:
    """A curve and the place of its panel's lower left corner [in]; `lowest`: no panel is below it."""

    curve: Curve
    x: float
    y: float
    lowest: bool

    def holding(self, shape: Any) -> Any:
        """Return points of a shape [in], moved into this panel."""
        return np.asarray(shape) + np.array((self.x, self.y))


def panels_guide() -> str:
    """Explain how to read the panels, in one sentence."""
    return (
        "Each panel shows one solver's curve of the profile above; the grey area is the highest curve of all solvers "
        "at each τ, so that the grey above a curve is what others solve sooner."
    )


def panels_figure(profile: Profile, title: str, kinds: Mapping[str, str], looks: Mapping[str, int]) -> Figure:
    """Draw the curves of a profile, highest right end first, a panel each.

    Parameters
    ----------
    title : what, how many problems, tolerance and limit. kinds : route kind of each label; inexact ones are dashed.
    looks : of each label (`analysis.looks`).
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    curves = [c for c in profile.by_height() if c.solved]
    rows = max(1, -(-len(curves) // ACROSS))
    height = ABOVE + rows * (HIGH + BETWEEN) - BETWEEN + BELOW
    with matplotlib.rc_context({**STYLE, "font.size": SMALL}):
        figure = Figure(figsize=(WIDTH, height), dpi=150)
        FigureCanvasAgg(figure)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, WIDTH), ylim=(0.0, height))
        axes.set_axis_off()
        axes.text(LEFT, height - 0.2, title, fontsize=10.5, fontweight="bold", va="center")
        _draw(axes, list(_placed(curves, height)), profile, kinds, looks)
    return figure


def _placed(curves: Sequence[Curve], height: float) -> Iterator[ProfilePanel]:
    for k, curve in enumerate(curves):
        row, column = divmod(k, ACROSS)
        x, y = LEFT + column * (WIDE + BESIDE), height - ABOVE - HIGH - row * (HIGH + BETWEEN)
        yield ProfilePanel(curve, x, y, lowest=k + ACROSS >= len(curves))


def _draw(
    axes: Axes, panels: Sequence[ProfilePanel], profile: Profile, kinds: Mapping[str, str], looks: Mapping[str, int]
) -> None:
    """Draw layer by layer: grid, grey area, curves, frames, words."""
    upto = right_end(profile)
    marks = [WIDE * math.log2(tau) / math.log2(upto) for tau in powers(upto, TICKS)]
    area = _corners(*thinned(*profile.envelope(upto), POINTS), upto)
    area = np.vstack(([0.0, 0.0], area, [WIDE, 0.0]))
    frame = [[(0.0, HIGH), (0.0, 0.0), (WIDE, 0.0)]]
    frame += [[(x, 0.0), (x, -TICK)] for x in marks] + [[(0.0, HIGH * y), (-TICK, HIGH * y)] for y in HEIGHTS]
    grid = [[(x, 0.0), (x, HIGH)] for x in marks] + [[(0.0, HIGH * y), (WIDE, HIGH * y)] for y in HEIGHTS]
    _lines(axes, _everywhere(grid, panels), color="#E4E4E4", linewidths=0.6, zorder=0.5)
    _areas(axes, _everywhere([area], panels))
    for dashed in (False, True):
        own = [p for p in panels if (kinds.get(p.curve.label, "") in INEXACT) == dashed]
        drawn = [p.holding(_corners(*p.curve.outline(upto, POINTS), upto)) for p in own]
        dashes: Any = legend.DASHES if dashed else "-"
        colours = [legend.colour(looks[p.curve.label]) for p in own]
        _lines(axes, drawn, colors=colours, linewidths=1.4, linestyles=[dashes], zorder=3)
    _lines(axes, _everywhere(frame, panels), color="black", linewidths=0.8, capstyle="projecting", zorder=2.5)
    for panel in panels:
        _words(axes, panel, profile, kinds, dict(zip(powers(upto, TICKS), marks, strict=True)))


def _corners(tau: Floats, height: Floats, upto: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the points [in] of a step curve that holds each value up to the next corner."""
    x, y = WIDE * np.log2(tau) / math.log2(upto), HIGH * height
    return np.column_stack((np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]))


def _everywhere(shapes: Sequence[Any], panels: Sequence[ProfilePanel]) -> list[Any]:
    """Return the same shapes in every panel."""
    return [panel.holding(shape) for panel in panels for shape in shapes]


def _lines(axes: Axes, lines: Sequence[Any], **look: Any) -> None:
    from matplotlib.collections import LineCollection

    axes.add_collection(LineCollection(lines, **look), autolim=False)


def _areas(axes: Axes, areas: Sequence[Any]) -> None:
    from matplotlib.collections import PolyCollection

    axes.add_collection(PolyCollection(areas, facecolors="#E3E3E3", linewidths=0, zorder=1), autolim=False)


def _words(
    axes: Axes, panel: ProfilePanel, profile: Profile, kinds: Mapping[str, str], marks: Mapping[float, float]
) -> None:
    """Write label and solved problems above the panel, fractions left of the first ones, ratios below the lowest."""
    heading = f"{marked(panel.curve.label, kinds, 26)}  {panel.curve.solved}/{profile.problems}"
    axes.text(panel.x, panel.y + HIGH + 3 / 72, heading, fontsize=8, va="baseline")
    gap = TICK + 3.5 / 72
    if panel.x == LEFT:
        for y in HEIGHTS:
            axes.text(panel.x - gap, panel.y + HIGH * y, f"{y:.1f}", ha="right", va="center")
    if panel.lowest:
        for tau, x in marks.items():
            axes.text(panel.x + x, panel.y - gap, power_text(tau), ha="center", va="top")
        axes.text(panel.x + WIDE / 2, panel.y - gap - 0.14, "τ", ha="center", va="top")
