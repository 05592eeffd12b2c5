"""Legends beside axes: one line a curve in the order of the curves' ends, with a number that matters."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PALETTE = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E69F00", "#56B4E9", "#882255", "#999933", "#332288"
)  # fmt: skip
"""Okabe and Ito's colours (different with every common colour blindness), without the yellow that white swallows; then
wine, olive and indigo of Tol's muted scheme."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p")
GREY = "#A6A6A6"
EMPHASISED = 7
"""Curves drawn in colour and with a marker; further ones are grey."""
LINES = 32
"""The most curves that are named; the grey ones beyond are counted."""
LINE = 0.19
"""Height of a line [in]."""
DASHES: Any = (0, (4, 2))
FIGURE_SPACE = "\N{FIGURE SPACE}"
"""As wide as a digit."""


@dataclass(frozen=True)
class LegendLine:
    """A curve's line: the `place` of its look (None: grey), `dashed`, and the number in front of its label."""

    label: str
    number: str
    place: int | None
    dashed: bool = False


def look(place: int | None, dashed: bool = False) -> dict[str, Any]:
    """Return how a curve is drawn: colour and marker of its place (`analysis.looks`), grey and thin without one."""
    dashes = DASHES if dashed else "-"
    if place is None:
        return {"color": GREY, "linewidth": 0.9, "linestyle": dashes}
    marker = {"marker": MARKERS[(place + place // len(PALETTE)) % len(MARKERS)], "markersize": 4.2}
    return {"color": colour(place), "linewidth": 1.7, "linestyle": dashes, **marker}


def colour(place: int) -> str:
    """Return the colour of a look."""
    return PALETTE[place % len(PALETTE)]


def height(curves: int, notes: int = 0, most: int = LINES) -> float:
    """Return the inches that a legend of so many curves takes."""
    return LINE * (min(curves, most) + notes + 1.5)


def beside(axes: Axes, head: str, lines: Sequence[LegendLine], notes: Sequence[str] = (), most: int = LINES) -> None:
    """Put the legend right of the axes, for which the layout makes room; `most` lines are named."""
    from matplotlib.lines import Line2D

    grey = [line for line in lines if line.place is None]
    unnamed = {line.label for line in grey[max(0, most - len(lines) + len(grey)) :]}
    named = [line for line in lines if line.label not in unnamed]
    texts = [f"and {len(unnamed)} more in grey"] if unnamed else []
    for note in notes:
        texts += textwrap.wrap(note, 40)
    wide = max((len(line.number) for line in named), default=0)
    handles = [Line2D([], [], **look(line.place, line.dashed)) for line in named]
    handles += [Line2D([], [], linestyle="none")] * len(texts)
    labels = [f"{line.number.rjust(wide, FIGURE_SPACE)}  {line.label}" for line in named]
    made = axes.legend(
        handles, [*labels, *texts], loc="upper left", bbox_to_anchor=(1.0, 1.0), title=head, title_fontsize=7.8,
        fontsize=8, alignment="left", frameon=False, borderaxespad=0.3, labelspacing=0.35,
    )  # fmt: skip
    for text, line in zip(made.get_texts(), [*named, *[None] * len(texts)], strict=True):
        text.set_color("#111111" if line is not None and line.place is not None else "#666666")


def needed(axes: Axes) -> float:
    """Return the height [in] of a figure in which the legend beside these axes has room."""
    outside = axes.get_legend()
    return 0.0 if outside is None else 0.16 * (len(outside.get_texts()) + 2)


def inside(axes: Axes) -> None:
    """Put the coloured lines of the legend beside the axes into them, where they cover least of the curves."""
    from matplotlib.lines import Line2D

    outside = axes.get_legend()
    if outside is None:
        return
    named = [
        (line, text.get_text().replace(FIGURE_SPACE, ""))
        for line, text in zip(outside.legend_handles, outside.get_texts(), strict=True)
        if isinstance(line, Line2D) and line.get_linestyle() != "None" and line.get_color() != GREY
    ]
    title = f"({outside.get_title().get_text().partition('  ')[0]})"
    outside.remove()
    if named:
        handles, labels = zip(*named, strict=True)
        frame: Any = {"framealpha": 0.85, "edgecolor": "none", "borderpad": 0.3, "labelspacing": 0.25}
        axes.legend(
            handles, labels, loc="best", fontsize=6.5, title=title, title_fontsize=6.5, handlelength=1.8, **frame
        )
