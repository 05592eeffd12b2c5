"""Figures made from the curves of `analysis`, the same bytes for the same data on the same matplotlib.

The object interface with the Agg canvas is used throughout: no pyplot, no global state, no window.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from cpbench.analysis.profiles import Curve, Profile
from cpbench.formulations.base import Kind
from cpbench.report import legend
from cpbench.report.legend import EMPHASISED, LINES
from cpbench.report.text import counted

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = {str(Kind.APPROXIMATE): "≈", str(Kind.RELAXATION): "⊇", str(Kind.NECESSARY): "?"}
"""Sign of a route that promises less than an answer, behind the label."""
INEXACT = tuple(str(kind) for kind in Kind if not kind.exact)
ACROSS = "τ: time / fastest time (failures: ∞), log scale"
LABEL_LENGTH = 30
POINTS, GREY_POINTS = 1_000, 500
"""The most corners of a curve, in colour and in grey: none is off by more than this part of the axis, less than the
width of its line."""
TICKS = ((100, (1,)), (8, (1, 2, 5)), (3, (1, 2, 3, 4, 6, 8)), (0, range(1, 10)))
"""Of a logarithmic axis within a decade, by the least ratio of its ends: so few that their labels do not touch."""
STYLE = {
    "text.parse_math": False,  # a label is text, whatever dollar signs it has
    "svg.hashsalt": "cpbench",
    "svg.fonttype": "path",
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
}


def profile_guide(problems: int, cost: str = "time", least: str = "the fastest") -> str:
    """Explain how to read a performance profile, in one sentence."""
    best = "the fastest solver" if least == "the fastest" else least
    ahead = "it was the fastest" if least == "the fastest" else "it needed least"
    return (
        f"The height of a curve at τ is the fraction of the {counted(problems, 'problem')} that the solver solved "
        f"within τ times the {cost} of {best} of that problem: at the left end the fraction where {ahead}, "
        "at the right end the fraction it solved at all."
    )


def profile_axes(
    axes: Axes,
    profile: Profile,
    kinds: Mapping[str, str],
    looks: Mapping[str, int],
    across: str = "",
    most: int = LINES,
) -> None:
    """Draw curves with their legend beside them, the leading ones in colour.

    Parameters
    ----------
    across : label of the axis of τ, where the cost is not the time. most : lines of the legend.
    """
    curves = [c for c in profile.by_height() if c.solved]
    places = {label: looks[label] for label in profile.leading(EMPHASISED)}
    upto = right_end(profile)
    for curve in reversed(curves):
        place, dashed = places.get(curve.label), kinds.get(curve.label, "") in INEXACT
        tau, height = curve.outline(upto, GREY_POINTS if place is None else POINTS)
        layer = 2 if place is None else 5 if dashed else 4  # between its dashes, what lies under it shows
        marks: dict[str, Any] = {} if place is None else {"markevery": (0, max(1, len(tau) // 6)), "clip_on": False}
        axes.plot(tau, height, drawstyle="steps-post", **legend.look(place, dashed), **marks, zorder=layer)
    frame(axes, upto, 12)
    axes.set_xlabel(across or ACROSS, fontsize=8.5)
    axes.set_ylabel(f"fraction of the {counted(profile.problems, 'problem')} solved")
    if not curves:
        nothing(axes, "no problem was solved")
    lines = [
        legend.LegendLine(
            marked(curve.label, kinds), str(curve.solved), places.get(curve.label), kinds.get(curve.label) in INEXACT
        )
        for curve in curves
    ]
    legend.beside(axes, "solved   sorted by problems solved", lines, _notes(profile.curves, kinds), most)


def _notes(curves: Sequence[Curve], kinds: Mapping[str, str]) -> list[str]:
    """Return what a legend has to add: the signs that occur, and the labels that solved none."""
    shown = {kinds.get(curve.label, "") for curve in curves}
    idle = sorted(curve.label for curve in curves if not curve.solved)
    signs = ", ".join(f"{mark} {kind}" for kind, mark in MARKS.items() if kind in shown)
    unsolved = "solved none: " + ", ".join(marked(label, kinds) for label in idle) if idle else ""
    return [text for text in (signs, unsolved) if text]


def log_axis(axes: Axes, which: Literal["x", "y"], text: Callable[[float], str]) -> None:
    """Set up a logarithmic axis with a grid; ticks at decades, or more often where these are few."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    axis = axes.xaxis if which == "x" else axes.yaxis
    (axes.set_xscale if which == "x" else axes.set_yscale)("log")
    low, high = axis.get_view_interval()
    subs = next(subs for least, subs in TICKS if high >= least * low)
    axis.set_major_locator(LogLocator(10.0, subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: text(value)))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
    axes.grid(True, color="#E4E4E4", linewidth=0.6)
    axes.set_axisbelow(True)


def nothing(axes: Axes, why: str) -> None:
    """Say in an empty axes why it is empty."""
    axes.text(0.5, 0.5, why, transform=axes.transAxes, ha="center", fontsize=12, color="#666666")


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write `name`.png and .svg, without dates or versions in them; gives their paths. A figure for print is made by
    `cpbench plot`: a PDF takes twice as long as both.
    """
    import matplotlib

    paths = [folder / f"{name}.{suffix}" for suffix in ("png", "svg")]
    with matplotlib.rc_context(STYLE), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # a label may use any script
        figure.savefig(paths[0], metadata={"Software": None})
        figure.savefig(paths[1], metadata={"Date": None, "Creator": None})
    return paths


def right_end(profile: Profile) -> float:
    """Return the next power of two beyond the last step, so that every curve ends flat."""
    end = 2.0
    while end <= profile.widest * 1.05:
        end *= 2.0
    return end


def frame(axes: Axes, upto: float, ticks: int) -> None:
    """Set the scales, ticks and grid that every profile has."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    axes.set_xscale("log", base=2)
    axes.set_xlim(1.0, upto)
    axes.set_ylim(0.0, 1.0)
    axes.xaxis.set_major_locator(FixedLocator(powers(upto, ticks)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: power_text(value)))
    axes.set_yticks([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    axes.grid(True, color="#E4E4E4", linewidth=0.6)
    axes.set_axisbelow(True)


def powers(upto: float, ticks: int) -> list[float]:
    """Return powers of two from 1 to `upto`, about so many.

    >>> powers(1024.0, 5)
    [1.0, 8.0, 64.0, 512.0]
    """
    found = [2.0**k for k in range(0, 64) if 2.0**k <= upto]
    return found[:: 1 + len(found) // ticks]


def marked(label: str, kinds: Mapping[str, str], length: int = LABEL_LENGTH) -> str:
    """Format a label that fits, with the sign of its route."""
    return "\N{NO-BREAK SPACE}".join(filter(None, (shorten(label, length), MARKS.get(kinds.get(label, "")))))


def power_text(value: float) -> str:
    """Format a ratio as the axis writes it.

    >>> power_text(8.0), power_text(2.0**20)
    ('8', '2²⁰')
    """
    exponent = round(value).bit_length() - 1
    return f"{value:g}" if value < 10_000 else "2" + str(exponent).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))


def shorten(label: str, length: int = LABEL_LENGTH) -> str:
    """Shorten a label so that it fits into a figure.

    >>> shorten("nsgs[omega=1.2]", 8)
    'nsgs[om…'
    """
    label = " ".join(label.split())
    return label if len(label) <= length else label[: length - 1] + "…"
