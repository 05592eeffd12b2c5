"""Facets in place of the disk of friction: (41)-(48)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cpbench import FrictionContact, make
from cpbench.foundation.matrices import Vector, norm
from cpbench.report import canvas
from lecture import cells, svg
from lecture.blocks import Block, Figure, Heading, Section, Try, aside, formula, table, text
from lecture.conversions import data, shown, trips
from lecture.numerics.examples import problems
from lecture.numerics.facet_errors import FAST, FacetedSlide, bounds, faceted_slide
from lecture.numerics.friction import outer_law
from lecture.numerics.round_trips import answer, round_trip

COUNTS = (4, 8, 16, 64)
FACETS = 8


def section() -> Section:
    """(41)-(48)."""
    problem = problems()["sliding"]
    assert isinstance(problem, FrictionContact)
    return Section(
        "facets",
        "Friction by facets",
        text(
            "In the plane friction is linear complementarity. In space the cone is round; facets make it linear again."
        ),
        (*_plane(), *_disk(problem), *_outer(problem), *_inner(problem), *_price()),
    )


def _plane() -> tuple[Block, ...]:
    return (
        Heading("In the plane: no facets needed"),
        text(
            "Coulomb's law in two dimensions has a cone of two edges, $D=[1,-1]$ below, and becomes an LCP exactly. "
            "Two contacts, of which one slides and one opens:"
        ),
        *shown(trips("plane", "fc-lcp-2d")),
    )


def _disk(problem: FrictionContact) -> tuple[Block, ...]:
    found = answer(problem)
    return (
        Heading("In space: a disk"),
        text(
            "For a normal impulse $r_{\\mathrm N}$ the tangential one stays in a disk of radius $\\mu r_{\\mathrm N}$,",
        ),
        formula(
            r"C(\mu r_{\mathrm N})=\left\{r_{\mathrm T}:"
            r"\;\sigma(r_{\mathrm T})=\mu r_{\mathrm N}-\|r_{\mathrm T}\|\ge0\right\}",
            41,
        ),
        text(
            "whose border is curved: no LCP has it exactly. Our contact slides, in a direction that no octagon likes:",
        ),
        data(problem, "W", "q", "mu"),
        text(
            "The law itself, by Gauss and Seidel's method for cones: $r$ = «r», $u$ = «u», error «error».",
            r=found.point.r, u=problem.slacks(found.point)["u"], error=cells.error(found.error),
        ),
    )  # fmt: skip


def _outer(problem: FrictionContact) -> tuple[Block, ...]:
    trip = round_trip(problem, "fc-mlcp-outer", facets=FACETS)
    r = trip.lifted.arrays()["r"]
    v = answer(trip.target).point.v
    law = outer_law(problem, r, v, FACETS)
    other = round_trip(problem, "fc-lcp-outer", facets=FACETS).lifted.arrays()["r"]
    return (
        Heading("From outside"),
        text("Cut the plane by $\\nu$ half planes that touch the disk, with outward normals $c_i$:"),
        formula(
            r"C_{\mathrm{outer}}(\mu r_{\mathrm N})=\bigcap_{i=1}^{\nu}C_i(\mu r_{\mathrm N}),"
            r"\qquad C_i(\mu r_{\mathrm N})=\left\{r_{\mathrm T}:"
            r"\;\sigma_i(r_{\mathrm T})=\mu r_{\mathrm N}-c_i^{\top}r_{\mathrm T}\ge0\right\}",
            42,
        ),
        text("The sliding velocity is opposite to the normal cone of the polygon instead of the disk's,"),
        formula(r"-u_{\mathrm T}\in N_{C_{\mathrm{outer}}(\mu r_{\mathrm N})}(r_{\mathrm T})", 43),
        text("and the normal cone of an intersection is a sum,"),
        formula(
            r"N_{C_{\mathrm{outer}}(\mu r_{\mathrm N})}(r_{\mathrm T})=\sum_{i=1}^{\nu}N_{C_i(\mu r_{\mathrm "
            r"N})}(r_{\mathrm T})",
            44,
        ),
        text("each part of which is a ray, along the derivative of its $\\sigma_i$:"),
        formula(
            r"-u_{\mathrm T}\in\sum_{i=1}^{\nu}-\kappa_i\,\partial\sigma_i(r_{\mathrm T}),\qquad"
            r"0\le\sigma_i(r_{\mathrm T})\perp\kappa_i\ge0",
            45,
        ),
        text("As $\\sigma_i$ is linear, this is linear complementarity:"),
        formula(
            r"-u_{\mathrm T}=\sum_{i=1}^{\nu}\kappa_i\,c_i,\qquad0\le\sigma_i(r_{\mathrm T})\perp\kappa_i\ge0", 46
        ),
        text(
            "With $\\nu$ = «facets»: $\\kappa$ = «kappa», and $u_{\\mathrm T}+\\sum\\kappa_ic_i$ has length "
            "«mismatch». With the sign that the lecture prints in (46) it would have «printed».",
            facets=FACETS, kappa=law.kappa, mismatch=cells.error(law.mismatch), printed=law.printed,
        ),
        text(
            "A circumscribed polygon is an inscribed one of another circle, so the same answer comes out of the form "
            "below without an inverse: `fc-mlcp-outer` and `fc-lcp-outer` differ by «apart».",
            apart=cells.error(norm(r - other)),
        ),
    )  # fmt: skip


def _inner(problem: FrictionContact) -> tuple[Block, ...]:
    return (
        Heading("From inside"),
        text("Or take the hull of $\\nu$ vertices on the circle, the columns of $D$, which come in opposite pairs:"),
        formula(
            r"C_{\mathrm{inner}}(\mu r_{\mathrm N})=\left\{r_{\mathrm T}=D\beta:\;\beta\ge0,"
            r"\;\mu r_{\mathrm N}\ge e^{\top}\beta\right\}",
            47,
        ),
        text("Its law is the LCP of Stewart and Trinkle[^stewart] and of Anitescu and Potra[^anitescu]:"),
        formula(
            r"\begin{cases}r_{\mathrm T}=D\beta\\0\le\beta\perp\lambda e+D^{\top}u_{\mathrm T}\ge0\\"
            r"0\le\lambda\perp\mu r_{\mathrm N}-e^{\top}\beta\ge0\end{cases}",
            48,
        ),
        _polygons(problem),
        *shown(
            trips("sliding", "fc-lcp-inner", "fc-lcp-outer", "fc-mlcp-outer"),
            "Each solves its own polygon to rounding; the error here is that of the polygon.",
        ),
    )


def _price() -> tuple[Block, ...]:
    slides = [faceted_slide("inner", count) for count in COUNTS]
    rows = [
        (
            str(slide.facets),
            cells.number(slide.largest_slip_angle, 3),
            cells.number(bounds(np.array(float(slide.facets)))["angle"], 5),
            cells.number(100.0 * slide.radius_error, 3),
        )
        for slide in slides
    ]
    alt = "Friction against the direction of sliding for polygons, which is a circle for the disk"
    with canvas.drawing():
        figure = canvas.page(canvas.COLUMN, 3.3)
        _rose(figure.add_axes((0.045, 0.06, 0.9, 0.84), projection="polar"), slides)
        drawn = svg.inline(figure, "fig-facets", alt)
    return (
        Heading("The price: directions"),
        text(
            "A polygon prefers its corners. While a contact slides, friction should point straight against the "
            "motion; with facets it points to a vertex. One contact, sliding at «fast» times its speed of approach, "
            "solved in «count» directions for each $\\nu$:",
            fast=int(FAST),
            count=len(slides[0].direction),
        ),
        table(
            ("facets $\\nu$", "direction wrong by [°]", "at most $180/\\nu$ [°]", "friction too small by [%]"),
            rows,
            "Inner facets, the worst of all directions, measured on solved problems.",
        ),
        Figure(
            drawn,
            text("Friction against the sliding, by its direction, of inner facets; the grey circle is Coulomb's."),
            alt,
        ),
        aside(
            "Two more warnings",
            text(
                "Facets make friction anisotropic, and the faster a contact slides the better a wrong direction hides "
                "behind large numbers: the page's error is relative. That is why the library measures the slip angle "
                "of every answer."
            ),
            text("And the LCP (48) need not have a solution for every $q$: its matrix is copositive, no P-matrix."),
        ),
        Try(
            (
                "cpbench solve problems.h5::sliding --solver lemke --via 'inner[facets=16]'",
                "cpbench convert problems.h5::sliding sliding-as-lcp.h5 --to lcp --via 'inner[facets=8]'",
                "cpbench solve problems.h5::plane --solver lemke",
            )
        ),
    )


def _rose(axes: Any, slides: Sequence[FacetedSlide]) -> None:
    """Draw the friction against the sliding by the direction of sliding, of the three smallest numbers of facets."""
    turn = np.linspace(0.0, 2.0 * np.pi, 361)
    axes.plot(turn, np.ones_like(turn), color="#BDBDBD", linewidth=3.5, zorder=1)
    for place, (slide, colour) in enumerate(zip(slides, (canvas.RED, canvas.BLUE, canvas.INK), strict=False)):
        half = np.radians(slide.direction)
        angle = np.concatenate([half, half + np.pi, half[:1] + 2.0 * np.pi])
        value = np.concatenate([slide.resistance, slide.resistance, slide.resistance[:1]])
        axes.plot(angle, value, color=colour, linewidth=1.3, zorder=4 - place)
        look = {"fontsize": 8, "fontweight": "bold", "ha": "center", "bbox": canvas.PLATE, "zorder": 9}
        axes.text(0.5, 0.64 - 0.075 * place, f"ν = {slide.facets}", color=colour, transform=axes.transAxes, **look)
    axes.set_ylim(0.0, 1.15)
    axes.set_yticks([0.5, 1.0])
    axes.set_yticklabels(["½", ""])
    axes.set_xticks(np.radians(np.arange(0, 360, 45)))
    axes.tick_params(pad=-2)
    axes.grid(color="#E2E2E2", linewidth=0.6)
    axes.spines["polar"].set_visible(False)


def _polygons(problem: FrictionContact) -> Figure:
    """The disk, both octagons, and the three answers, over μ r_N."""
    with canvas.drawing():
        figure = canvas.page(5.2, 2.7)
        axes = figure.add_axes((0.02, 0.02, 0.96, 0.96))
        turn = np.linspace(0.0, 2.0 * np.pi, 181)
        axes.fill(np.cos(turn), np.sin(turn), color=canvas.GREY, alpha=0.3, linewidth=0)
        axes.plot(np.cos(turn), np.sin(turn), color=canvas.GREY, linewidth=1.4)
        exact = answer(problem).point.r
        shares = [(_share(problem, exact), canvas.INK, "o", "the law itself")]
        for side, colour, marker, look in (
            ("inner", canvas.BLUE, "s", "-"), ("outer", canvas.RED, "D", (0, (4, 2))),
        ):  # fmt: skip
            corners = make(f"fc-lcp-{side}", {"facets": FACETS}).vertices  # type: ignore[attr-defined]
            axes.plot(*np.hstack([corners, corners[:, :1]]), color=colour, linewidth=1.3, linestyle=look)
            r = round_trip(problem, f"fc-lcp-{side}", facets=FACETS).lifted.arrays()["r"]
            shares.append((_share(problem, r), colour, marker, f"{side} polygon"))
        u = (problem.W @ exact + problem.q)[1:]
        against = -u / norm(u)
        axes.annotate("", 1.3 * against, (0, 0), arrowprops={"arrowstyle": "-", "color": canvas.GREY, "linewidth": 0.9})
        axes.text(*(1.33 * against), "straight against\nthe sliding", ha="right", va="center")
        for place, (share, colour, marker, name) in enumerate(shares):
            axes.plot(*share, marker, color=colour, markersize=6.5, zorder=6)
            axes.plot(1.45, 0.6 - 0.24 * place, marker, color=colour, markersize=6.5)
            axes.text(1.56, 0.6 - 0.24 * place, name, color=colour, va="center")
        axes.set_xlim(-2.45, 2.45)
        axes.set_ylim(-1.27, 1.27)
        axes.set_aspect("equal")
        axes.set_axis_off()
        drawn = svg.inline(
            figure, "fig-polygons", "A disk between two octagons, and three marks on them that do not agree"
        )
    return Figure(
        drawn,
        text(
            "Seen from above, over $\\mu r_{\\mathrm N}$: the disk between its octagons, and $r_{\\mathrm T}$ by each "
            "law."
        ),
        "Inner and outer octagon of the disk of friction",
    )


def _share(problem: FrictionContact, r: Vector) -> Vector:
    return r[1:] / (problem.mu[0] * r[0])
