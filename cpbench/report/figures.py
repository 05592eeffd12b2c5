"""Figures made from the curves of `analysis`, the same bytes for the same data on the same matplotlib.

The object interface with the Agg canvas is used throughout: no pyplot, no global state, no window.
"""

from __future__ import annotations

import textwrap
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cpbench.analysis.profiles import Curve, Profile
from cpbench.formulations.base import Kind
from cpbench.report.text import counted

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E69F00", "#56B4E9")
"""Okabe and Ito's colours (told apart with every common colour blindness), without the yellow that white swallows."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
GREY = "#A6A6A6"
EMPHASISED = len(PALETTE)
"""Curves drawn in colour; further ones are grey, with their numbers in the legend."""
MARKS = {str(Kind.APPROXIMATE): "≈", str(Kind.RELAXATION): "⊇", str(Kind.NECESSARY): "?"}
"""Sign of a route that promises less than an answer, behind the label."""
INEXACT = tuple(str(kind) for kind in Kind if not kind.exact)
LEGEND_LINES = 32
"""The most curves the legend names; the grey ones beyond are counted."""
PANELS = 4
"""Panels a row."""
LABEL_LENGTH = 30
LINE = 0.19
"""Height of a legend line [in]."""
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


def profile_guide(problems: int) -> str:
    """How to read a performance profile, in one sentence."""
    return (
        f"The height of a curve at τ is the fraction of the {counted(problems, 'problem')} that the solver solved "
        "within τ times the time of the fastest solver of that problem: at the left end the fraction where it was the "
        "fastest, at the right end the fraction it solved at all."
    )


def profile_figure(profile: Profile, title: str, kinds: Mapping[str, str]) -> Figure:
    """Performance profile of a group with an ordered legend beside it.

    Parameters
    ----------
    title : what, how many problems, tolerance and limit. kinds : route kind of each label; inexact ones are dashed.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    curves = [c for c in profile.by_height() if c.solved]
    colours = dict(zip(profile.leading(EMPHASISED), range(EMPHASISED), strict=False))
    idle = sorted(c.label for c in profile.curves if not c.solved)
    with matplotlib.rc_context(STYLE):
        height = max(4.6, 1.5 + LINE * (min(len(curves), LEGEND_LINES) + 3))
        figure = Figure(figsize=(9.2, height), dpi=150)
        FigureCanvasAgg(figure)
        bottom = 0.98 / height
        axes = figure.add_axes((0.065, bottom, 0.56, 0.99 - bottom - 0.42 / height))
        legend = figure.add_axes((0.685, bottom, 0.31, 0.99 - bottom - 0.42 / height))
        figure.text(0.065, 1 - 0.24 / height, title, fontsize=10.5, fontweight="bold", va="center")
        upto = _right_end(profile)
        for curve in reversed(curves):
            _draw(axes, curve, upto, colours.get(curve.label), kinds.get(curve.label, "") in INEXACT)
        _dress(axes, profile, upto)
        _legend(legend, curves, colours, kinds, idle)
        guide = textwrap.fill(profile_guide(profile.problems), 136)
        figure.text(0.065, 0.10 / height, guide, fontsize=7.8, color="#444444", va="bottom", linespacing=1.35)
    return figure


def panels_guide() -> str:
    """How to read the panels, in one sentence."""
    return (
        "Each panel shows one solver's curve of the profile above; the grey area is the highest curve of all solvers "
        "at each τ, so that the grey above a curve is what others solve sooner."
    )


def panels_figure(profile: Profile, title: str, kinds: Mapping[str, str]) -> Figure:
    """The same profile with a panel a solver, highest right end first: readable for any number of them."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    curves = [c for c in profile.by_height() if c.solved]
    rows = max(1, -(-len(curves) // PANELS))
    upto = _right_end(profile)
    area = profile.envelope(upto)
    with matplotlib.rc_context({**STYLE, "font.size": 7.5}):
        height = 0.55 + 1.45 * rows + 0.45
        figure = Figure(figsize=(9.2, height), dpi=150)
        FigureCanvasAgg(figure)
        figure.text(0.045, 1 - 0.2 / height, title, fontsize=10.5, fontweight="bold", va="center")
        grid = figure.subplots(rows, PANELS, sharex=True, sharey=True, squeeze=False)
        figure.subplots_adjust(0.045, 0.47 / height, 0.99, 1 - 0.6 / height, wspace=0.1, hspace=0.34)
        for axes, curve in zip(grid.flat, curves, strict=False):
            _frame(axes, upto, 5)
            inexact = kinds.get(curve.label, "") in INEXACT
            axes.fill_between(*area, step="post", color="#E3E3E3", linewidth=0, zorder=1)
            dashes: Any = (0, (4, 2)) if inexact else "-"
            axes.plot(
                *curve.steps(upto), drawstyle="steps-post", color=PALETTE[0], linewidth=1.4, linestyle=dashes, zorder=3
            )
            text = f"{_marked(curve.label, kinds, 26)}  {curve.solved}/{profile.problems}"
            axes.set_title(text, fontsize=8, loc="left", pad=3)
        for axes in list(grid.flat)[len(curves) :]:
            axes.set_axis_off()
        for axes in grid[-1][: len(curves) - PANELS * (rows - 1)]:
            axes.set_xlabel("τ")
    return figure


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write `name`.png and `name`.svg, without dates or versions in them; gives their paths."""
    import matplotlib

    paths = [folder / f"{name}.png", folder / f"{name}.svg"]
    with matplotlib.rc_context(STYLE), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # a label may use any script
        figure.savefig(paths[0], metadata={"Software": None})
        figure.savefig(paths[1], metadata={"Date": None, "Creator": None})
    return paths


def _right_end(profile: Profile) -> float:
    """The next power of two beyond the last step, so that every curve ends flat."""
    end = 2.0
    while end <= profile.widest * 1.05:
        end *= 2.0
    return end


def _draw(axes: Axes, curve: Curve, upto: float, place: int | None, dashed: bool) -> None:
    tau, height = curve.steps(upto)
    dashes: Any = (0, (4, 2)) if dashed else "-"
    if place is None:
        axes.plot(tau, height, drawstyle="steps-post", color=GREY, linewidth=0.9, linestyle=dashes, zorder=2)
        return
    axes.plot(
        tau,
        height,
        drawstyle="steps-post",
        color=PALETTE[place],
        linewidth=1.7,
        linestyle=dashes,
        marker=MARKERS[place],
        markersize=4.2,
        markevery=(0, max(1, len(tau) // 6)),
        clip_on=False,
        zorder=5 if dashed else 4,  # between its dashes, what lies under it shows
    )


def _dress(axes: Axes, profile: Profile, upto: float) -> None:
    _frame(axes, upto, 12)
    axes.set_xlabel(
        "τ: time over the time of the fastest, log scale (failures are at ∞, beyond the right end)", fontsize=8.5
    )
    axes.set_ylabel(f"fraction of the {counted(profile.problems, 'problem')} solved")
    if not any(curve.solved for curve in profile.curves):
        axes.text(
            0.5, 0.5, "no problem was solved", transform=axes.transAxes, ha="center", fontsize=12, color="#666666"
        )


def _frame(axes: Axes, upto: float, ticks: int) -> None:
    """Scales, ticks and grid that every profile has."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    axes.set_xscale("log", base=2)
    axes.set_xlim(1.0, upto)
    axes.set_ylim(0.0, 1.0)
    powers = [2.0**k for k in range(0, 64) if 2.0**k <= upto]
    axes.xaxis.set_major_locator(FixedLocator(powers[:: 1 + len(powers) // ticks]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: power_text(value)))
    axes.set_yticks([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])
    axes.grid(True, color="#E4E4E4", linewidth=0.6)
    axes.set_axisbelow(True)


def _legend(
    axes: Axes, curves: Sequence[Curve], colours: Mapping[str, int], kinds: Mapping[str, str], idle: Sequence[str]
) -> None:
    """One line a curve, in the order of their right ends, with the number solved."""
    axes.set_axis_off()
    lines = axes.figure.get_figheight() * axes.get_position().height / LINE  # type: ignore[union-attr]
    axes.set_xlim(0.0, 1.0)
    axes.set_ylim(lines, 0.0)
    axes.text(0.0, 0.0, "solved   highest right end first", fontsize=7.8, color="#444444", va="center")
    grey = [c.label for c in curves if c.label not in colours]
    unnamed = set(grey[max(0, LEGEND_LINES - len(colours)) :])
    named = [c for c in curves if c.label not in unnamed]
    for line, curve in enumerate(named, start=1):
        place = colours.get(curve.label)
        colour = GREY if place is None else PALETTE[place]
        inexact = kinds.get(curve.label, "") in INEXACT
        axes.plot(
            [0.12, 0.165, 0.21],
            [line, line, line],
            color=colour,
            linewidth=0.9 if place is None else 1.7,
            linestyle=(0, (4, 2)) if inexact else "-",
            marker="" if place is None else MARKERS[place],
            markevery=[1],
            markersize=4.2,
        )
        ink = "#666666" if place is None else "#111111"
        axes.text(0.085, line, str(curve.solved), fontsize=8, color=ink, va="center", ha="right")
        axes.text(0.24, line, _marked(curve.label, kinds), fontsize=8, color=ink, va="center")
    notes = [f"and {len(unnamed)} more in grey"] if unnamed else []
    found = {kinds.get(label, "") for label in (*(curve.label for curve in named), *idle)}
    notes += [", ".join(f"{mark} {kind}" for kind, mark in MARKS.items() if kind in found)] if found & {*MARKS} else []
    if idle:
        notes += textwrap.wrap("solved none: " + ", ".join(_marked(label, kinds) for label in idle), 48)
    room = max(1, int((lines - len(named) - 1.4) / 0.85) + 1)
    for k, text in enumerate(notes if len(notes) <= room else [*notes[: room - 1], "…"]):
        axes.text(0.0, len(named) + 1.4 + k * 0.85, text, fontsize=7.2, color="#666666", va="center")


def _marked(label: str, kinds: Mapping[str, str], length: int = LABEL_LENGTH) -> str:
    """A label that fits, with the sign of its route."""
    return "\N{NO-BREAK SPACE}".join(filter(None, (shorten(label, length), MARKS.get(kinds.get(label, "")))))


def power_text(value: float) -> str:
    """A ratio as the axis writes it.

    >>> power_text(8.0), power_text(2.0**20)
    ('8', '2²⁰')
    """
    exponent = round(value).bit_length() - 1
    return f"{value:g}" if value < 10_000 else "2" + str(exponent).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))


def shorten(label: str, length: int = LABEL_LENGTH) -> str:
    """A label that fits into a figure.

    >>> shorten("nsgs[omega=1.2]", 8)
    'nsgs[om…'
    """
    label = " ".join(label.split())
    return label if len(label) <= length else label[: length - 1] + "…"
