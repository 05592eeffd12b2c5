"""Errors of facets in place of Coulomb's disk: friction against the direction of sliding, and errors against ν.

Measured: one contact is solved by fc-lcp-inner, fc-lcp-outer and Lemke's method, sliding in 360 directions. With FILE
it is a contact of that problem alone (its W_cc and μ), without it W = I, μ = 0.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cpbench import graph
from cpbench.errors import NotApplicable
from cpbench.formulations.base import Point, Problem
from cpbench.formulations.local_contact import FrictionContact
from cpbench.foundation.matrices import Dense
from cpbench.report import canvas
from cpbench.report.figure_kinds import Drawing, Need, figure_kind
from cpbench_lab.figures.facet_errors import FAST, SIDES, FacetedSlide, bounds, faceted_slide
from cpbench_lab.pictures.cone import chosen

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROSES = 3
"""Numbers of facets that the polar panel shows, the smallest ones; more would hide one another."""
SHADES = (canvas.RED, canvas.BLUE, canvas.INK)
LOOKS: dict[str, dict[str, Any]] = {"inner": {"linestyle": "-"}, "outer": {"linestyle": (0, (3, 1.5))}}


@figure_kind(
    "facets",
    problem=Need.OPTIONAL,
    facets="Numbers of facets ν.",
    contact="Number of the contact in FILE, from 0 (default: the first with friction).",
)
def draw(
    problem: Problem | None = None,
    point: Point | None = None,
    *,
    facets: tuple[int, ...] = (4, 8, 16, 64),
    contact: int = -1,
) -> Drawing:
    """Draw a polar panel and an error panel."""
    mu, W, named = _contact(problem, contact)
    counts = sorted(set(facets))
    slides = [faceted_slide(side, count, mu, W) for count in counts for side in SIDES]
    figure = canvas.page(canvas.PAGE, 3.3)
    rose: Any = figure.add_axes((0.045, 0.06, 0.4, 0.84), projection="polar")
    _polar(rose, [s for s in slides if s.facets in counts[:ROSES]])
    upper, lower = figure.add_axes((0.585, 0.555, 0.4, 0.4)), figure.add_axes((0.585, 0.13, 0.4, 0.345))
    _errors(upper, lower, slides)
    angles = canvas.joined([f"{s.largest_slip_angle:.4g}° (ν = {s.facets})" for s in slides if s.side == "inner"])
    guide = (
        r"Left: friction against the sliding, $-r_\mathrm{T} \cdot t\, /\, \mu r_\mathrm{N}$, for every direction $t$ "
        "of sliding; Coulomb's disk is the grey circle, solid curves have inner facets, dashed ones outer. Right: the "
        f"largest errors over {len(slides[0].direction)} directions in half a turn, measured (marks), and their "
        f"suprema (lines). Largest slip angles of inner facets: {angles}, at {FAST:g} times the speed of approach."
    )
    return Drawing(figure, f"Facets for Coulomb's disk: {named}", guide)


def _contact(problem: Problem | None, contact: int) -> tuple[float, Dense | None, str]:
    """Return μ and W_cc of one contact, and its name."""
    if problem is None:
        return 0.5, None, r"one contact, $\mu$ = 0.5"
    if getattr(problem, "dimension", 0) != 3 or problem.node not in ("fc", "fcm", "gfc"):
        raise NotApplicable("facets", f"are for three-dimensional contacts of fc, fcm and gfc; this is {problem.node}")
    local = graph.arrive(problem, "fc").problem
    assert isinstance(local, FrictionContact)
    place = chosen(local, None, contact)
    mu = float(local.mu[place])
    return mu, local.diagonal_blocks[place], rf"{canvas.literal(problem.name)}, contact {place}, $\mu$ = {mu:.3g}"


def _polar(axes: Any, slides: Sequence[FacetedSlide]) -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.plot(turn, np.ones_like(turn), color="#BDBDBD", linewidth=3.5, zorder=1)
    for slide in slides:
        place = sorted({s.facets for s in slides}).index(slide.facets)
        half = np.radians(slide.direction)
        angle = np.concatenate([half, half + np.pi, half[:1] + 2.0 * np.pi])
        value = np.concatenate([slide.resistance, slide.resistance, slide.resistance[:1]])
        axes.plot(angle, value, color=SHADES[place], linewidth=1.3, zorder=4 - place, **LOOKS[slide.side])
    axes.set_ylim(0.0, 1.45)
    axes.set_yticks([0.5, 1.0])
    axes.set_yticklabels(["½", ""])
    axes.set_rlabel_position(292)
    axes.set_xticks(np.radians(np.arange(0, 360, 45)))
    axes.tick_params(pad=-2)
    axes.grid(color="#E2E2E2", linewidth=0.6)
    axes.spines["polar"].set_visible(False)
    for place, count in enumerate(sorted({s.facets for s in slides})):
        axes.text(
            0.5, 0.64 - 0.075 * place, f"ν = {count}", color=SHADES[place], fontsize=8, fontweight="bold",
            ha="center", transform=axes.transAxes, bbox=canvas.PLATE, zorder=9,
        )  # fmt: skip


def _errors(upper: Axes, lower: Axes, slides: Sequence[FacetedSlide]) -> None:
    """Draw friction above, slip angle below, against ν; marks are measured, lines are the formulas."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    counts = sorted({s.facets for s in slides})
    fine = np.geomspace(counts[0] / 1.2, counts[-1] * 1.2, 200)
    suprema = bounds(fine)
    upper.plot(fine, suprema["inner"], color=canvas.INK, linewidth=0.9, **LOOKS["inner"])
    upper.plot(fine, suprema["outer"], color=canvas.INK, linewidth=0.9, **LOOKS["outer"])
    lower.plot(fine, suprema["angle"], color=canvas.INK, linewidth=0.9)
    for side, marker, fill in (("inner", "o", canvas.INK), ("outer", "D", "white")):
        own = [s for s in slides if s.side == side]
        look: dict[str, Any] = {"color": canvas.INK, "markerfacecolor": fill, "markersize": 4.2, "linestyle": "none"}
        upper.plot([s.facets for s in own], [s.radius_error for s in own], marker, zorder=5, **look)
        lower.plot([s.facets for s in own], [s.largest_slip_angle for s in own], marker, zorder=5, **look)
    for axes in (upper, lower):
        axes.set_xscale("log", base=2)
        axes.set_yscale("log")
        axes.set_xlim(fine[0], fine[-1])
        axes.xaxis.set_major_locator(FixedLocator(counts))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.0f}"))
        axes.grid(True, color="#ECECEC", linewidth=0.6)
        axes.set_axisbelow(True)
    upper.tick_params(labelbottom=False)
    upper.set_ylabel("friction wrong by")
    upper.text(
        0.97, 0.93, r"outer ◇  too large, $1/\cos(\pi/\nu) - 1$", ha="right", va="top", transform=upper.transAxes
    )
    upper.text(0.97, 0.80, r"inner ●  too small, $1 - \cos(\pi/\nu)$", ha="right", va="top", transform=upper.transAxes)
    lower.set_xlabel("ν, number of facets")
    lower.set_ylabel(r"slip angle")
    lower.text(0.97, 0.92, "180°/ν", ha="right", va="top", transform=lower.transAxes)
    for axes, unit, factor in ((upper, " %", 100.0), (lower, "°", 1.0)):
        axes.yaxis.set_major_locator(FixedLocator(_ticks(*axes.get_ylim())))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _, u=unit, f=factor: f"{f * value:g}{u}"))


def _ticks(low: float, high: float) -> list[float]:
    """Return at least three round numbers of a logarithmic axis where it has them, and no more than need be."""
    result: list[float] = []
    for steps in ((1.0,), (1.0, 3.0), (1.0, 2.0, 5.0), (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0)):
        result = [s * 10.0**k for k in range(-9, 4) for s in steps if low <= s * 10.0**k <= high]
        if len(result) >= 3:
            break
    return result
