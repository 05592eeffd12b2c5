"""Legends beside a figure: one line a curve in the order of the curves' ends, with a number that matters."""

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
LEGEND = "legend"
"""Label of the axes that hold one."""
DASHES: Any = (0, (4, 2))


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


def within(axes: Axes, source: Axes) -> None:
    """Put the coloured lines of a legend into the axes of the curves, where they cover least of them."""
    named = [
        (line, f"{label.get_text()} ({number.get_text()})")
        for line, number, label in zip(source.lines, source.texts[1::2], source.texts[2::2], strict=False)
        if line.get_color() != GREY
    ]
    if not named:
        return
    handles, labels = zip(*named, strict=True)
    frame: Any = {"framealpha": 0.85, "edgecolor": "none", "borderpad": 0.3, "handlelength": 1.8, "labelspacing": 0.25}
    title = source.texts[0].get_text().partition("  ")[0]
    axes.legend(handles, labels, loc="best", fontsize=6.5, title=f"({title})", title_fontsize=6.5, **frame)


def beside(
    axes: Axes,
    head: str,
    lines: Sequence[LegendLine],
    notes: Sequence[str] = (),
    indent: float = 0.0,
    most: int = LINES,
) -> None:
    """Fill an empty axes with the legend.

    Parameters
    ----------
    indent : room for longer numbers, as a share of the width. most : lines that are named.
    """
    axes.set_axis_off()
    axes.set_label(LEGEND)
    fit = axes.figure.get_figheight() * axes.get_position().height / LINE  # type: ignore[union-attr]
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(fit, 0.0)
    axes.text(0.0, 0.0, head, fontsize=7.8, color="#444444", va="center")
    grey = [line for line in lines if line.place is None]
    unnamed = {line.label for line in grey[max(0, most - len(lines) + len(grey)) :]}
    named = [line for line in lines if line.label not in unnamed]
    for at, line in enumerate(named, start=1):
        ends = [indent + x for x in (0.12, 0.165, 0.21)]
        axes.plot(ends, [at] * 3, **look(line.place, line.dashed), markevery=[1])
        ink = "#666666" if line.place is None else "#111111"
        axes.text(0.085 + indent, at, line.number, fontsize=8, color=ink, va="center", ha="right")
        axes.text(0.24 + indent, at, line.label, fontsize=8, color=ink, va="center")
    texts = [f"and {len(unnamed)} more in grey"] if unnamed else []
    for note in notes:
        texts += textwrap.wrap(note, 48)
    room = max(1, int((fit - len(named) - 1.4) / 0.85) + 1)
    for k, text in enumerate(texts if len(texts) <= room else [*texts[: room - 1], f"{texts[room - 1]} …"]):
        axes.text(0.0, len(named) + 1.4 + k * 0.85, text, fontsize=7.2, color="#666666", va="center")
