"""The size of a figure of a run, and where its legend stands: sizes of letters and margins stay, axes give way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from cpbench.errors import CpbenchError
from cpbench.report import legend
from cpbench.report.legend import LEGEND, LINE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PLACES = ("beside", "below", "inside", "none")
"""Where a legend may stand."""
NARROW = 4.5
"""Width below which a figure is for one column: legend inside, narrow margins, no guide [in]."""
LEAST = 0.8
"""Width and height that the axes need at least [in]."""
RIGHT = 0.17
"""Margin at the right where no legend is: half of the last tick's label [in]."""
MARGINS = (0.42, 0.38, 0.09, 0.05)
"""Left, below, right and above where the legend is inside [in]."""
GAP = 0.12
"""Between a legend and the edge, and above a legend that is below [in]."""

Box = tuple[float, float, float, float]
"""Left, bottom, right, top [in]."""


def arrange(figure: Figure, width: float, height: float, place: str) -> None:
    """Make a figure `width` × `height` [in, NaN: as it is] with its legend at `place` ('': inside a figure of one
    column, else beside, as it is).

    Raises CpbenchError for a legend that is not there, and where a size leaves no room.
    """
    old_width, old_height = figure.get_size_inches()
    legends = [axes for axes in figure.axes if axes.get_label() == LEGEND]
    drawn = [axes for axes in figure.axes if axes not in legends]
    if place and place not in PLACES:
        raise CpbenchError(f"--legend {place}: one of {', '.join(PLACES)}")
    if place and not legends:
        raise CpbenchError(f"--legend {place}: this figure has no legend")
    if not place and math.isnan(width) and math.isnan(height):
        return
    if legends and (place == "inside" or (not place and narrow(width))):
        _inside(figure, drawn, legends[0], old_width if math.isnan(width) else width, height)
        return
    beside = place in ("", "beside") and bool(legends)
    lines = _lines(legends[0]) * LINE if legends else 0.0
    boxes = [_inches(axes, old_width, old_height) for axes in drawn]
    left, low, right, top = _around(boxes)
    wide = _inches(legends[0], old_width, old_height) if beside else None
    margin = old_width - right if not legends or beside else RIGHT
    extra = lines + GAP if place == "below" else 0.0
    width = old_width if math.isnan(width) else width
    height = old_height + extra if math.isnan(height) else height
    new: Box = (left, low + extra, width - margin, height - (old_height - top))
    if new[2] - new[0] < LEAST:
        advice = "; --legend inside, below or none needs less" if beside else ""
        raise CpbenchError(f"--width {width:g} in: at least {width + LEAST - new[2] + new[0]:.2g} in{advice}")
    needed = max(LEAST - new[3] + new[1], lines - new[3] if beside else 0.0)
    if needed > 0:
        raise CpbenchError(f"--height {height:g} in: at least {height + needed:.2g} in are needed here")
    figure.set_size_inches(width, height)
    for axes, box in zip(drawn, boxes, strict=True):
        _put(axes, _moved(box, (left, low, right, top), new), width, height)
    if wide is not None:
        start = new[2] + wide[0] - right
        _legend(legends[0], (start, new[3] - lines, start + wide[2] - wide[0], new[3]), width, height)
    elif place == "below":
        _legend(legends[0], (GAP, GAP / 2, width - GAP, GAP / 2 + lines), width, height)
    else:
        for axes in legends:
            axes.remove()


def narrow(width: float) -> bool:
    """Return whether a figure of this width [in] is for one column; not where it is NaN."""
    return width < NARROW


def scale(figure: Figure, width: float, height: float) -> None:
    """Make a figure of fixed places `width` × `height` [in]; where one is NaN, its shape stays."""
    old_width, old_height = figure.get_size_inches()
    if math.isnan(width) and math.isnan(height):
        return
    if math.isnan(height):
        height = old_height * width / old_width
    if math.isnan(width):
        width = old_width * height / old_height
    for value, flag in ((width, "--width"), (height, "--height")):
        if value < LEAST:
            raise CpbenchError(f"{flag} {value:.2g} in: at least {LEAST:g} in are needed here")
    figure.set_size_inches(width, height)


def _inside(figure: Figure, drawn: Sequence[Axes], source: Axes, width: float, height: float) -> None:
    """Let the axes fill the figure but for their labels, as high as it is wide by default, and put the legend into
    them."""
    old = figure.get_size_inches()
    height = width if math.isnan(height) else height
    left, low, right, top = MARGINS
    boxes = [_inches(axes, *old) for axes in drawn]
    new: Box = (left, low, width - right, height - top)
    for length, flag, k in ((width, "--width", 0), (height, "--height", 1)):
        if new[k + 2] - new[k] < LEAST:
            needed = length + LEAST - new[k + 2] + new[k]
            raise CpbenchError(f"{flag} {length:.2g} in: at least {needed:.2g} in are needed here")
    figure.set_size_inches(width, height)
    for axes, box in zip(drawn, boxes, strict=True):
        _put(axes, _moved(box, _around(boxes), new), width, height)
        for label in axes.get_xticklabels()[-1:]:
            label.set_horizontalalignment("right")  # or half of it would be cut
    legend.within(drawn[0], source)
    source.remove()


def _lines(axes: Axes) -> float:
    """Count the lines of a legend."""
    return 1.0 + max((float(text.get_position()[1]) for text in axes.texts), default=0.0)


def _inches(axes: Axes, width: float, height: float) -> Box:
    box = axes.get_position(original=True)
    return box.x0 * width, box.y0 * height, box.x1 * width, box.y1 * height


def _around(boxes: Sequence[Box]) -> Box:
    left, low, right, top = zip(*boxes, strict=True)
    return min(left), min(low), max(right), max(top)


def _moved(box: Box, old: Box, new: Box) -> Box:
    """Move a box to the same place within `new` as it has within `old`."""

    def at(value: float, k: int) -> float:
        return new[k] + (value - old[k]) / (old[k + 2] - old[k]) * (new[k + 2] - new[k])

    return at(box[0], 0), at(box[1], 1), at(box[2], 0), at(box[3], 1)


def _put(axes: Axes, box: Box, width: float, height: float) -> None:
    axes.set_position((box[0] / width, box[1] / height, (box[2] - box[0]) / width, (box[3] - box[1]) / height))


def _legend(axes: Axes, box: Box, width: float, height: float) -> None:
    """Put a legend into a box; its lines stay as high, and its samples as long, as they were."""
    _put(axes, box, width, height)
    axes.set_ylim((box[3] - box[1]) / LINE - 0.5, -0.5)
