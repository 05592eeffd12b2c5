"""Inequalities over a set that is projected on, and over a set that moves: beside (22)-(26)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cpbench import QVI, VI
from cpbench.foundation.matrices import Vector, norm
from cpbench.report import canvas
from lecture import cells, svg
from lecture.blocks import Block, Figure, Formula, Heading, Try, text
from lecture.conversions import by_solvers, shown, trips
from lecture.formulas import maps
from lecture.numerics.examples import problems
from lecture.numerics.round_trips import answer


def curved() -> tuple[Block, ...]:
    """A VI over the unit disk."""
    problem = problems()["disk"]
    assert isinstance(problem, VI)
    z = answer(problem).point.z
    F = problem.F(z)
    return (
        Heading("A set to project on"),
        text(
            "A ball has no rows to price, and no multipliers; its projection is written down at once. Over the unit "
            "disk, with a spring that hardens and a swirl:"
        ),
        maps(problem, "F"),
        _disk(problem, z),
        text(
            "The solution $z$ = «z» is the projection of $z-F(z)$, to «error», and lies on the rim: $\\|z\\|$ = "
            "«length». There $-F(z)=\\nu z$ with $\\nu$ = «nu», and what is left of $F$ along the rim is «along». "
            "Without the disk the inequality is the equation $F(z)=0$, whose zero «free» is outside.",
            z=z,
            error=cells.error(norm(problem.defect(z, F))),
            length=norm(z),
            nu=float(-F @ z),
            along=cells.error(abs(float(F[0] * z[1] - F[1] * z[0]))),
            free=answer(problems()["plane-equation"]).point.z,
        ),
        *shown(
            [
                *trips("disk", "vi-ge"),
                *trips("plane-equation", "vi-equation"),
                *trips("cubic-cone-inequality", "vi-cp"),
            ]
        ),
        by_solvers("disk", "newton-vi", "projection-vi", "extragradient-vi"),
        Try(("cpbench solve problems.h5::disk --solver extragradient-vi",)),
    )


def moving() -> tuple[Block, ...]:
    """A QVI: two firms and one limit."""
    problem = problems()["duopoly"]
    assert isinstance(problem, QVI)
    z = answer(problem).point.z
    w = problem.F(z)
    _, lower, upper = problem.set_at(z)
    far = replace(problem, start=np.array([10.0, 0.0]))
    other = answer(far)
    return (
        Heading("A set that moves"),
        text("In a *quasi-variational inequality* the set depends on the point that stands in it: $z\\in X(z)$ with"),
        Formula(r"F(z)^{\top}(y-z)\ge0\quad\forall\,y\in X(z)", label="as (22)"),
        text(
            "Two firms share a limit[^harker]. Each takes what it likes of what the other leaves, $y_i\\le"
            "\\mathrm{upper}_i(z)$, and nobody more than «most»:",
            most=float(problem.ub[0]),
        ),
        maps(problem, "F", "upper"),
        _firms(problem, z),
        text(
            "Here $z$ = «z», where $F(z)$ = «w»; the set that belongs to it goes from «lower» to «upper», and "
            "does not bind. It is not the only solution. From «far» the solver comes to «other», where the limit is "
            "shared out and $F$ = «force»: both would take more. Its error is «error».",
            z=z,
            w=w,
            lower=lower,
            upper=upper,
            far=far.start,
            other=other.point.z,
            force=problem.F(other.point.z),
            error=cells.error(other.error),
        ),
        by_solvers("duopoly", "newton-qvi", "projection-qvi"),
        text("What bounds and rows demand of all players at once is a mixed complementarity problem:"),
        *shown(trips("duopoly", "qvi-micp")),
        text("Coulomb's friction is one of these, as a later section shows: the disk moves with the normal impulse."),
        Try(("cpbench solve problems.h5::duopoly --solver projection-qvi",)),
    )


def _disk(problem: VI, z: Vector) -> Figure:
    """The disk, −F inside, the projection of z − F(z)."""
    with canvas.drawing():
        figure = canvas.page(5.2, 3.0)
        axes = figure.add_axes((0.02, 0.02, 0.96, 0.96))
        around = np.linspace(0.0, 2.0 * np.pi, 181)
        axes.fill(np.cos(around), np.sin(around), color=canvas.BLUE, alpha=0.13, linewidth=0)
        axes.plot(np.cos(around), np.sin(around), color=canvas.BLUE, linewidth=1.6)
        line = np.arange(-0.8, 0.81, 0.4)
        grid = np.array([(a, b) for a in line for b in line if a * a + b * b < 0.9])
        force = -np.array([problem.F(point) for point in grid])
        axes.quiver(*grid.T, *force.T, color=canvas.GREY, angles="xy", scale_units="xy", scale=9, width=0.0045)
        out = z - problem.F(z)
        axes.plot(*np.array([np.zeros(2), z]).T, color=canvas.GREEN, linewidth=1.2, linestyle=(0, (4, 2)))
        axes.annotate(
            "", (out[0], out[1]), (z[0], z[1]), zorder=6,
            arrowprops={"arrowstyle": "-|>", "color": canvas.RED, "linewidth": 2.2},
        )  # fmt: skip
        axes.plot(*z, "o", color=canvas.RED, markersize=6, zorder=7)
        axes.text(out[0] + 0.06, out[1], "$z - F(z)$", color=canvas.RED, fontsize=9, va="center")
        axes.text(z[0] + 0.03, z[1] - 0.08, "$z$", color=canvas.RED, fontsize=10, va="top")
        axes.text(-0.9, 0.75, "$X$", color=canvas.BLUE, fontsize=11, ha="right")
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.set_xlim(-1.15, max(1.15, out[0] + 0.6))
        axes.set_ylim(-1.05, 1.05)
        drawn = svg.inline(figure, "fig-disk", "Arrows in a disk; at the solution the arrow points straight outwards")
    return Figure(
        drawn,
        text("Grey arrows: $-F$. At $z$ the red one, drawn in full, points straight out, and projects back on $z$."),
        "A variational inequality over a disk",
    )


def _firms(problem: QVI, z: Vector) -> Figure:
    """X(z) of two points, the shared limit, where each firm is content."""
    with canvas.drawing():
        figure = canvas.page(5.2, 2.9)
        axes = figure.add_axes((0.09, 0.14, 0.895, 0.84))
        a, b = np.meshgrid(np.linspace(0.0, 10.5, 81), np.linspace(0.0, 10.5, 81))
        values = np.array([problem.F(np.array(point)) for point in zip(a.ravel(), b.ravel(), strict=True)])
        for k, (colour, look) in enumerate(((canvas.BLUE, "solid"), (canvas.GREEN, "dashed"))):
            axes.contour(a, b, values[:, k].reshape(a.shape), [0.0], colors=colour, linewidths=1.4, linestyles=look)
        shared = np.array([(t, problem.upper(np.array([t, t]))[1]) for t in (4.5, 10.5)])
        axes.plot(*shared.T, color=canvas.INK, linewidth=1.2)
        for point, colour in ((problem.start, canvas.GREY), (z, canvas.RED)):
            _, low, high = problem.set_at(point)
            axes.plot([low[0], high[0], high[0], low[0], low[0]], [low[1], low[1], high[1], high[1], low[1]],
                      color=colour, linewidth=1.4, linestyle=(0, (4, 2)), clip_on=False)  # fmt: skip
            axes.plot(*point, "o", color=colour, markersize=6, zorder=6, clip_on=False)
        axes.text(z[0] - 0.15, z[1] - 0.15, "$z$", color=canvas.RED, ha="right", va="top", fontsize=10)
        axes.set_xlim(0.0, 10.6)
        axes.set_ylim(0.0, 10.6)
        axes.set_xlabel("$z_1$", labelpad=1)
        axes.set_ylabel("$z_2$", labelpad=1)
        drawn = svg.inline(
            figure, "fig-firms", "Two lines that cross at the solution, with the sets of the origin and of the solution"
        )
    return Figure(
        drawn,
        text(
            "Dashed: $X(z)$ of the origin (grey) and of the solution (red). On the blue line $F_1=0$, on the green one "
            "$F_2=0$; black, the shared limit."
        ),
        "A quasi-variational inequality of two firms",
    )
