"""Variational inequalities: (22)-(26)."""

from __future__ import annotations

import numpy as np

from cpbench import AVI
from cpbench.foundation.matrices import Vector, dense
from cpbench.report import canvas
from lecture import cells, sets, svg
from lecture.blocks import Block, Figure, Heading, Section, Try, aside, formula, table, text
from lecture.conversions import data, shown, trips
from lecture.numerics.examples import problems
from lecture.numerics.inequalities import interval, least_product, normal_map, polygon
from lecture.numerics.round_trips import answer

OFFSETS = ((2.0, 0.6), (2.0, -1.2), (2.0, -3.0))
"""Slope and offset of three maps over [0, 1], whose solutions are at 0, inside and at 1."""


def section() -> Section:
    """(22)-(26)."""
    return Section(
        "variational",
        "Variational inequalities",
        text("Stand at a point of a set so that the wind blows you into the wall, or does not blow at all."),
        (*_inequality(), *_boxes(), *_normal_map(), *sets.curved(), *sets.moving()),
    )


def _inequality() -> tuple[Block, ...]:
    avi = problems()["avi"]
    assert isinstance(avi, AVI)
    found = answer(avi)
    z, corners = found.point.z, polygon(avi)
    least = least_product(dense(avi.M), avi.q, z, corners)
    return (
        text("Given a set $X$ and a map $F$, the *variational inequality* is to find $z\\in X$ with"),
        formula(r"F(z)^{\top}(y-z)\ge0\quad\forall\,y\in X", 22),
        text("If you think of $-F$ as a force, it points out of $X$, or is zero: it lies in the normal cone at $z$,"),
        formula(r"-F(z)\in N_X(z)", 23),
        text("which is the same as"),
        formula(r"0\in F(z)+N_X(z)", 24),
        text(
            "For $X$ closed and convex and $F$ continuous the set of solutions is closed. With $X=\\mathbb{R}^{n}$ "
            "the normal cone is $\\{0\\}$ and the inequality is just $F(z)=0$. Our $F(z)=Mz+q$ is no gradient, for "
            "$M$ is not symmetric; no quadratic program stands behind it. $X$ is a triangle:"
        ),
        data(avi, "M", "q", "A", "b"),
        _triangle(avi, z, corners),
        text(
            "At $z$ = «z» the least $F(z)^{\\top}(y-z)$ over the corners $y$ of the triangle is «least»; being linear "
            "in $y$, it is not less inside. The multipliers of the walls are «lam».",
            z=z,
            least=least,
            lam=found.point.lam,
        ),
        *shown([*trips("avi", "avi-mlcp", "avi-vi"), *trips("linear-vi", "vi-avi", "vi-micp", "vi-ge")]),
    )


def _boxes() -> tuple[Block, ...]:
    known = problems()
    found = answer(known["relay"])
    return (
        Heading("Boxes"),
        text("The set that is met most often is a rectangle, possibly unbounded:"),
        formula(r"K=\left\{x\in\mathbb{R}^{n}:\;-\infty\le a_i\le x_i\le b_i\le+\infty\right\}", 25),
        text(
            "The orthant is one, so every LCP is such an inequality. A bounded box with an affine map is a *relay*: "
            "switches that saturate at $-1$ and $1$ and hold somewhere in between, where $w=Mz+q$ is zero."
        ),
        data(known["relay"], "M", "q", "lb", "ub"),
        text(
            "Here $z$ = «z» and $w$ = «w»: the first switch is saturated, the second one holds.",
            z=found.point.z,
            w=known["relay"].slacks(found.point)["w"],
        ),
        *shown([*trips("relay", "relay-lcp", "relay-avi"), *trips("avi-box", "avi-lcp-bounds", "avi-relay", "avi-qp")]),
        Try(
            (
                "cpbench solve problems.h5::avi --solver lemke",
                "cpbench solve problems.h5::relay --solver newton-relay",
                "cpbench graph problems.h5::avi-box --to lcp",
            )
        ),
    )


def _normal_map() -> tuple[Block, ...]:
    rows = []
    for slope, offset in OFFSETS:
        avi = interval(slope, offset)
        x = answer(avi).point.z
        zero = x - (avi.M @ x + avi.q)
        rows.append(
            (
                f"$F(z)={slope:g}z{offset:+g}$",
                cells.vector(x),
                cells.vector(zero),
                cells.error(abs(normal_map(avi, zero)[0])),
            )
        )
    return (
        Heading("The normal map"),
        text("With the projection $\\Pi_K$ on the set, (22) becomes an equation[^robinson]:"),
        formula(r"\mathbf{F}_K^{\mathrm{nor}}(z)=F(\Pi_K(z))+z-\Pi_K(z)", 26),
        text("A zero $z$ of it is not a solution; its projection $x=\\Pi_K(z)$ is, and $z=x-F(x)$."),
        _kinks(),
        table(
            ("over $[0,1]$", "solution $x$", "zero $z$ of (26)", "value there"),
            rows,
            "Three maps over the smallest box there is.",
        ),
        aside(
            "What it costs",
            text(
                "Projection methods need $\\Pi_K$ only, and are slow; Newton's method needs its derivative as well. "
                "Where $K$ has structure, it pays to go on to complementarity or to a nonsmooth equation."
            ),
        ),
    )


def _triangle(avi: AVI, z: Vector, corners: np.ndarray) -> Figure:
    """X, −F at some points, the normal cone at z."""
    M, q = dense(avi.M), avi.q
    with canvas.drawing():
        figure = canvas.page(5.2, 3.0)
        axes = figure.add_axes((0.02, 0.02, 0.96, 0.96))
        axes.fill(*corners.T, color=canvas.BLUE, alpha=0.13, linewidth=0)
        axes.plot(*np.vstack([corners, corners[:1]]).T, color=canvas.BLUE, linewidth=1.6)
        grid = np.array([(a, b) for a in np.arange(0.2, 2.0, 0.4) for b in np.arange(0.2, 2.0, 0.4) if a + b < 1.95])
        force = -(grid @ M.T + q)
        axes.quiver(*grid.T, *force.T, color=canvas.GREY, angles="xy", scale_units="xy", scale=8, width=0.0045)
        walls = dense(avi.A)[np.abs(dense(avi.A) @ z - avi.b) < 1e-9]
        normals = -walls / np.linalg.norm(walls, axis=1)[:, None]
        wedge = np.vstack([z, z + 0.85 * normals])
        axes.fill(*wedge.T, color=canvas.GREEN, alpha=0.2, linewidth=0)
        for normal in normals:
            axes.plot(*np.array([z, z + 0.85 * normal]).T, color=canvas.GREEN, linewidth=1.4)
        pull = -(M @ z + q)
        tip = z + 0.6 * pull / np.linalg.norm(pull)
        axes.annotate(
            "",
            (tip[0], tip[1]),
            (z[0], z[1]),
            arrowprops={"arrowstyle": "-|>", "color": canvas.RED, "linewidth": 2.2},
            zorder=6,
        )
        axes.plot(*z, "o", color=canvas.RED, markersize=6, zorder=7)
        axes.text(tip[0] + 0.05, tip[1] - 0.06, "$-F(z)$", color=canvas.RED, fontsize=9, va="top")
        axes.text(z[0] - 0.05, z[1] - 0.06, "$z$", color=canvas.RED, fontsize=10, ha="right", va="top")
        axes.text(z[0] + 0.62, z[1] + 0.18, "$N_X(z)$", color=canvas.GREEN, fontsize=9)
        axes.text(0.62, 1.6, "$X$", color=canvas.BLUE, fontsize=11)
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.margins(0.06)
        drawn = svg.inline(
            figure, "fig-triangle", "Arrows in a triangle; at the solution the arrow points into the normal cone"
        )
    return Figure(
        drawn,
        text(
            "Grey arrows: $-F$. They drift to a corner, where the red one falls into the green normal cone: (23) holds."
        ),
        "An affine variational inequality over a triangle",
    )


def _kinks() -> Figure:
    """Normal maps of three problems over [0, 1]."""
    with canvas.drawing():
        figure = canvas.page(5.2, 2.5)
        axes = figure.add_axes((0.11, 0.16, 0.875, 0.82))
        along = np.linspace(-1.6, 2.9, 181)
        axes.axvspan(0.0, 1.0, color=canvas.FAINT, alpha=0.6, linewidth=0)
        axes.axhline(0.0, color=canvas.INK, linewidth=0.8)
        for (slope, offset), colour, look in zip(
            OFFSETS, (canvas.BLUE, canvas.GREEN, canvas.RED), ("-", (0, (5, 2)), (0, (1.5, 1.5))), strict=True
        ):
            avi = interval(slope, offset)
            axes.plot(
                along, [normal_map(avi, np.array([y]))[0] for y in along], color=colour, linewidth=1.6, linestyle=look
            )
            x = answer(avi).point.z
            zero = float((x - (avi.M @ x + avi.q))[0])
            axes.plot(zero, 0.0, "o", color=colour, markersize=6, zorder=5)
        axes.text(0.5, 3.1, "$K$", ha="center", va="center", fontsize=10)
        axes.set_xlabel("$z$", labelpad=1)
        axes.set_ylabel(r"$\mathbf{F}^{\mathrm{nor}}_K(z)$")
        axes.set_ylim(-3.6, 3.6)
        drawn = svg.inline(
            figure, "fig-kinks", "Three broken lines that cross zero before, in and behind the shaded interval"
        )
    return Figure(
        drawn,
        text("Each broken line has its kinks at the ends of $K$. Its zero (dot) projects on the solution."),
        "Normal maps over an interval",
    )
