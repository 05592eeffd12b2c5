"""Curves of solvers in figures of runs: their styles, their legend, and the axes that they share."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from cpbench.analysis.profiles import Curve, Profile
from cpbench.formulations.base import Kind
from cpbench.report import canvas
from cpbench.report.text import counted, cut

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PALETTE = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E69F00", "#56B4E9", "#882255", "#999933", "#332288"
)  # fmt: skip
"""Okabe and Ito's colours (different with every common colour blindness), without the yellow that white swallows; then
wine, olive and indigo of Tol's muted scheme."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">", "p")
GREY, DIM = "#A6A6A6", "#666666"
"""Colour of the curves that are not emphasised, and of what a legend says of them."""
EMPHASISED = 7
"""Curves drawn in colour and with a marker; further ones are grey."""
LINES = 20
"""The most curves that a legend names; the grey ones beyond are counted."""
LINE = 0.19
"""Height of a line of a legend [in]."""
DASHES: Any = (0, (4, 2))
FIGURE_SPACE = "\N{FIGURE SPACE}"
"""A space as wide as a digit."""
MARKS = {str(Kind.APPROXIMATE): "≈", str(Kind.RELAXATION): "⊇", str(Kind.NECESSARY): "?"}
"""Sign of a route that promises less than an answer, behind the label."""
INEXACT = tuple(str(kind) for kind in Kind if not kind.exact)
LABEL_LENGTH = 30
POINTS, GREY_POINTS = 1_000, 500
"""The most corners of a curve, in colour and in grey: none is off by more than this part of the axis, less than the
width of its line."""
TICKS = ((100, (1,)), (8, (1, 2, 5)), (3, (1, 2, 3, 4, 6, 8)), (0, range(1, 10)))
"""Ticks of a logarithmic axis within a decade, by the least ratio of its ends: so few that labels do not touch."""


@dataclass(frozen=True, eq=False)
class Line:
    """A curve and its line in the legend: the number in front of its label, the corners, the `style` of its line (None:
    grey), and whether it is dashed."""

    label: str
    number: str
    x: Any
    y: Any
    style: int | None
    dashed: bool = False


def line_style(style: int | None, dashed: bool = False) -> dict[str, Any]:
    """Return how a curve is drawn: colour and marker by its style (`analysis.line_styles`), grey and thin without."""
    dashes = DASHES if dashed else "-"
    if style is None:
        return {"color": GREY, "linewidth": 0.9, "linestyle": dashes}
    marker = MARKERS[(style + style // len(PALETTE)) % len(MARKERS)]
    return {"color": colour(style), "linewidth": 1.7, "linestyle": dashes, "marker": marker, "markersize": 4.2}


def colour(style: int) -> str:
    """Return the colour of a style."""
    return PALETTE[style % len(PALETTE)]


def with_room(curves: int, notes: int = 3) -> tuple[Figure, Axes]:
    """Create a figure two columns wide with axes and room for the legend of so many curves beside them."""
    height = max(2.9, LINE * (min(curves, LINES) + notes + 1.5) + 0.3)
    figure = canvas.page(canvas.PAGE, height, constrained=True)
    return figure, figure.subplots()


def draw_lines(axes: Axes, lines: Sequence[Line], steps: bool = True, **coloured: Any) -> None:
    """Draw curves, the first in front; those in colour have their words for a legend. `coloured` : of their lines."""
    wide = max((len(line.number) for line in lines), default=0)
    for k, line in enumerate(lines):
        drawn, layer = line_style(line.style, line.dashed), 2.0
        if line.style is not None:
            drawn |= {"markevery": (0, max(1, len(line.x) // 6)), "label": _words(line, wide)} | coloured
            layer = 5.0 if line.dashed else 4.0  # between its dashes, what lies under it shows
        how = "steps-post" if steps else "default"
        axes.plot(line.x, line.y, drawstyle=how, **drawn, zorder=layer - k / len(lines))


def _words(line: Line, wide: int) -> str:
    return f"{line.number.rjust(wide, FIGURE_SPACE)}  {line.label}"


def legend_beside(axes: Axes, head: str, lines: Sequence[Line], notes: Sequence[str] = ()) -> None:
    """Name the curves right of the axes, for which the layout makes room; LINES of them, those in colour first."""
    from matplotlib.lines import Line2D

    grey = [line.label for line in lines if line.style is None]
    unnamed = grey[max(0, LINES - len(lines) + len(grey)) :]
    named = [line for line in lines if line.label not in unnamed]
    texts = [f"and {len(unnamed)} more in grey"] if unnamed else []
    for note in notes:
        texts += textwrap.wrap(note, 40)
    wide = max((len(line.number) for line in named), default=0)
    axes.legend(
        [Line2D([], [], **line_style(one.style, one.dashed)) for one in named] + [Line2D([], [], ls="")] * len(texts),
        [*(_words(line, wide) for line in named), *texts],
        labelcolor=[*(DIM if line.style is None else "#111111" for line in named), *[DIM] * len(texts)],
        loc="upper left", bbox_to_anchor=(1.0, 1.0), title=head, title_fontsize=7.8, fontsize=8, alignment="left",
    )  # fmt: skip


def profile_lines(
    profile: Profile,
    curves: Sequence[Curve],
    coloured: Sequence[str],
    styles: Mapping[str, int],
    kinds: Mapping[str, str],
) -> list[Line]:
    """Return the curves of a profile that solved something, those `coloured` with their styles."""
    lines: list[Line] = []
    for curve in curves:
        if curve.solved:
            style = styles[curve.label] if curve.label in coloured else None
            tau, height = curve.outline(right_end(profile), GREY_POINTS if style is None else POINTS)
            dashed = kinds.get(curve.label, "") in INEXACT
            lines.append(Line(marked(curve.label, kinds), str(curve.solved), tau, height, style, dashed))
    return lines


def profile_axes(
    axes: Axes, profile: Profile, kinds: Mapping[str, str], styles: Mapping[str, int], across: str = "τ"
) -> None:
    """Draw a profile with its legend beside it, the leading curves in colour. `across` : label of the axis of τ."""
    lines = profile_lines(profile, profile.by_height(), profile.leading(EMPHASISED), styles, kinds)
    draw_lines(axes, lines, clip_on=False)
    profile_scales(axes, profile, 12)
    axes.set_xlabel(across)
    axes.set_ylabel(f"fraction of the {counted(profile.problems, 'problem')} solved")
    if not lines:
        nothing(axes, "no problem was solved")
    legend_beside(axes, "solved   sorted by problems solved", lines, _notes(profile.curves, kinds))


def _notes(curves: Sequence[Curve], kinds: Mapping[str, str]) -> list[str]:
    """Return what a legend has to add: the signs that occur, and the labels that solved none."""
    shown = {kinds.get(curve.label, "") for curve in curves}
    idle = sorted(curve.label for curve in curves if not curve.solved)
    signs = ", ".join(f"{mark} {kind}" for kind, mark in MARKS.items() if kind in shown)
    unsolved = "solved none: " + ", ".join(marked(label, kinds) for label in idle) if idle else ""
    return [text for text in (signs, unsolved) if text]


def profile_scales(axes: Axes, profile: Profile, ticks: int) -> None:
    """Set the scales, ticks and grid that every profile has; about so many ticks of τ."""
    upto = right_end(profile)
    powers = 2.0 ** np.arange(np.log2(upto) + 1)
    powers = powers[:: 1 + len(powers) // ticks]
    axes.set_xscale("log", base=2)
    axes.set_xticks(powers, [power_text(power) for power in powers])
    axes.minorticks_off()
    axes.set_xlim(1.0, upto)
    axes.set_ylim(0.0, 1.0)
    axes.grid(True)


def log_axis(axes: Axes, which: Literal["x", "y"], text: Callable[[float], str]) -> None:
    """Set up a logarithmic axis with a grid; ticks at decades, or more often where these are few."""
    from matplotlib.ticker import LogLocator

    axis = axes.xaxis if which == "x" else axes.yaxis
    (axes.set_xscale if which == "x" else axes.set_yscale)("log")
    low, high = axis.get_view_interval()
    axis.set_major_locator(LogLocator(10.0, subs=next(subs for least, subs in TICKS if high >= least * low)))
    axis.set_major_formatter(lambda value, _: text(value))
    axis.minorticks_off()
    axes.grid(True)


def nothing(axes: Axes, why: str) -> None:
    """Say in an empty axes why it is empty."""
    axes.text(0.5, 0.5, why, transform=axes.transAxes, ha="center", fontsize=12, color=DIM)


def right_end(profile: Profile) -> float:
    """Return the next power of two beyond the last step, so that every curve ends flat."""
    return max(2.0, 2.0 ** np.ceil(np.log2(profile.widest * 1.05)))


def marked(label: str, kinds: Mapping[str, str], length: int = LABEL_LENGTH) -> str:
    """Format a label that fits, with the sign of its route."""
    return "\N{NO-BREAK SPACE}".join(filter(None, (cut(label, length), MARKS.get(kinds.get(label, "")))))


def power_text(value: float) -> str:
    """Format a power of two as the axis writes it.

    >>> power_text(8.0), power_text(2.0**20)
    ('8', '2²⁰')
    """
    exponent = round(np.log2(value))
    return f"{value:g}" if value < 10_000 else "2" + str(exponent).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
