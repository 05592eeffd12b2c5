"""Generalized and nonsmooth equations: (27)-(39)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from cpbench.foundation.matrices import Dense
from cpbench.report import canvas
from lecture import cells, solvable, svg
from lecture.blocks import Block, Figure, Heading, Section, Try, aside, formula, table, text
from lecture.numerics import ncp_functions as ncp
from lecture.numerics.examples.nonlinear import hock_schittkowski_14, hump, kojima_shindo
from lecture.numerics.inequalities import distance_to_normal_cone
from lecture.numerics.newton import (
    Iterate,
    generalized_newton,
    josephy_newton,
    least_singular_value,
    merit_slice,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STARTS = (np.array([1.0, 0.0, 0.0, 0.0]), np.array([0.9, 0.1, 2.8, 0.1]))
"""From the first one methods come to the degenerate solution, from the second one to the other."""
LOOKS = {
    "(35)": (canvas.INK, "o", "-"),
    "(36)": (canvas.BLUE, "s", "-"),
    "(37)": (canvas.GREEN, "^", (0, (5, 2))),
    "(38)": (canvas.RED, "D", (0, (1.5, 1.5))),
}


def section() -> Section:
    """(27)-(39)."""
    return Section(
        "nonsmooth",
        "Nonsmooth equations",
        text("Everything so far becomes one equation with corners, and Newton's method learns to live with corners."),
        (*_inclusion(), *solvable.inclusions(), *_newton(), *_functions(), *solvable.equations(), *_merit()),
    )


def _inclusion() -> tuple[Block, ...]:
    four, program = kojima_shindo(), hock_schittkowski_14()
    end = josephy_newton(program, program.start)[-1].x
    return (
        text("With a maximal monotone operator $T$, a *generalized equation* asks for $z$ with"),
        formula(r"0\in F(z)+T(z)", 27),
        text("Normal cones are such operators. The nonlinear problem (19) is"),
        formula(r"0\in F(z)+N_{\mathbb{R}^{n}_{+}}(z)", 28),
        text("and the optimality conditions (12) of a nonlinear program are"),
        formula(r"0\in F(z)+N_K(z),\qquad z\in\mathbb{R}^{n+m_e+m_i}", 29),
        formula(
            r"F(z,\lambda,\mu)=\begin{pmatrix}\nabla\mathcal{L}(z,\lambda,\mu)\\g(z)\\h(z)\end{pmatrix},\qquad "
            r"K=\mathbb{R}^{n}\times\mathbb{R}^{m_i}_{+}\times\mathbb{R}^{m_e}",
            30,
        ),
        text(
            "How far $0$ is from $F+N_K$ is measured by a projection. At the two published solutions of the test with "
            "four unknowns: «first» and «second». At what we found for problem 14: «program».",
            first=cells.error(distance_to_normal_cone(four, four.solutions[0])),
            second=cells.error(distance_to_normal_cone(four, four.solutions[1])),
            program=cells.error(distance_to_normal_cone(program, end)),
        ),
    )


def _newton() -> tuple[Block, ...]:
    return (
        Heading("Generalized Newton"),
        text("The idea: find an equation with the same solutions, whose corners are benign (*semismooth*),"),
        formula(r"0\in F(z)+T(z)\quad\Rightarrow\quad\Phi(z)=0", 31),
        text("and solve"),
        formula(r"\Phi(z)=0", 32),
        text("by taking, where the derivative does not exist, any element of the subdifferential:"),
        formula(r"z_{k+1}=z_k-H_k^{-1}\,\Phi(z_k),\qquad H_k\in\partial\Phi(z_k)", 33),
    )


def _functions() -> tuple[Block, ...]:
    example, functions = kojima_shindo(), ncp.functions()
    paths = [{f.equation: generalized_newton(example, f, start) for f in functions} for start in STARTS]
    rows = []
    for function in functions:
        one, other = (path[function.equation] for path in paths)
        rows.append(
            (
                cells.words(f"{function.equation} {function.name}"),
                str(len(other) - 1),
                cells.error(other[-1].residual),
                str(len(one) - 1),
                cells.error(one[-1].residual),
                cells.error(least_singular_value(example, function, example.solutions[0])),
            )
        )
    w, z = np.array([-1.0]), np.array([2.0 - 3.0**0.5])
    return (
        Heading("NCP functions"),
        text("A function of two numbers does the rewriting, if it vanishes exactly where they are complementary:"),
        formula(r"\psi(w,z)=0\quad\Leftrightarrow\quad0\le w\perp z\ge0", 34),
        text("The lecture names four: the minimum,"),
        formula(r"\psi_{\min}(w,z)=\min(w,z)", 35),
        text("the function of Fischer and Burmeister[^fischer], smooth but at the origin,"),
        formula(r"\psi_{\mathrm{FB}}(w,z)=\sqrt{z^2+w^2}-z-w", 36),
        text("a penalized one[^penalized] that also feels how far both are from zero,"),
        formula(
            r"\psi_{\mathrm{FB1}}(w,z)=\lambda\,\psi_{\mathrm{FB}}(w,z)-(1-\lambda)\max(0,z)\max(0,w),"
            r"\qquad0<\lambda<1",
            37
        ),
        text("and one that is differentiable everywhere[^evtushenko]:"),
        formula(r"\psi_{\mathrm{smooth}}(w,z)=wz-\tfrac12\min{}^2(0,z+w)", 38),
        _panels(),
        aside(
            "A sign",
            text(
                "The lecture prints (38) with a plus. That function also vanishes at $w$ = «w», $z$ = «z»: its value "
                "there is «printed». With the minus it is «mended».",
                w=float(w[0]), z=float(z[0]),
                printed=cells.error(abs(float(ncp.smooth_as_printed(w, z)[0]))), mended=float(ncp.smooth(w, z)[0]),
            ),
        ),
        text(
            "One problem, two solutions, four functions. From two starts, (33) with a line search takes the steps "
            "below. The second solution is nondegenerate and everybody is fast. At the first one $z_3=F_3=0$:"
        ),
        _race(paths[0]),
        table(
            ("function", "steps to $(1,0,3,0)$", "residual", "steps to $(\\tfrac12\\sqrt6,0,0,\\tfrac12)$", "residual",
             "least singular value of $H$ there"),
            rows,
            "The price of smoothness: a differentiable NCP function has zero gradient wherever both arguments vanish; "
            "that of (38) at the origin is «gradient», so that $H$ is singular at the degenerate solution.",
            gradient=np.concatenate(ncp.functions()[3].values(np.zeros(1), np.zeros(1))[1:]),
        ),
    )  # fmt: skip


def _merit() -> tuple[Block, ...]:
    return (
        Heading("A merit to go down on"),
        text("Far from a solution Newton's steps are shortened until"),
        formula(r"\Psi(z)=\tfrac12\,\Phi(z)^{\top}\Phi(z)", 39),
        text(
            "falls. For Fischer and Burmeister's function the square is differentiable everywhere, corners and all, "
            "which gives convergence from afar and quadratic convergence near by[^facchinei]."
        ),
        _slices(),
        Try(("cpbench list solvers",)),
    )


def _panels() -> Figure:
    """The four functions over the plane of w and z, with one colour scale, and the lines where they are 0."""
    alt = "Level lines of the four functions over the plane of w and z"
    with canvas.drawing():
        figure = canvas.page(canvas.COLUMN, 3.75)
        side = np.linspace(-2.0, 2.0, 401)  # odd, so that the axes w = 0 and z = 0 are among the samples
        w, z = np.meshgrid(side, side)
        for k, function in enumerate(ncp.functions()):
            axes = figure.add_axes((0.115 + 0.455 * (k % 2), 0.565 - 0.475 * (k // 2), 0.4, 0.3733))
            _panel(axes, function, w, z)
            if function.equation == "(38)":
                printed, dashed = ncp.smooth_as_printed(w, z), [(0, (3, 2))]
                axes.contour(w, z, printed, [0.0], colors=canvas.RED, linewidths=1.2, linestyles=dashed)
                axes.text(-1.9, -1.85, "(38) as printed", color="#A34700", fontsize=6.8, va="bottom", bbox=canvas.PLATE)
            axes.set_xlabel("$w$", labelpad=1) if k >= 2 else axes.tick_params(labelbottom=False)
            axes.set_ylabel("$z$", labelpad=-3) if k % 2 == 0 else axes.tick_params(labelleft=False)
        drawn = svg.inline(figure, "fig-ncp", alt, follow=False)
    return Figure(
        drawn,
        text("Heavy: where $\\psi=0$, the two half axes. Dashed red: the zeros of (38) as it is printed."),
        alt,
    )


def _panel(axes: Axes, function: ncp.NCPFunction, w: Dense, z: Dense) -> None:
    value = function.psi(w, z)
    shade = np.sign(value) * np.sqrt(np.abs(value))  # small values near the zeros are distinguished
    axes.pcolormesh(w, z, shade, cmap="RdBu", vmin=-3.5, vmax=3.5, shading="gouraud", rasterized=True, alpha=0.75)
    axes.contour(w, z, value, (-4.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 4.0), colors="#555555", linewidths=0.5)
    axes.contour(w, z, value, [0.0], colors=canvas.INK, linewidths=2.2)
    axes.set_aspect("equal")
    axes.set_xticks([-2, -1, 0, 1, 2])
    axes.set_yticks([-2, -1, 0, 1, 2])
    axes.set_title(f"{function.equation} {function.name}", fontsize=7.5, pad=3, loc="left")


def _race(paths: Mapping[str, list[Iterate]]) -> Figure:
    """Residuals by step."""
    with canvas.drawing():
        figure = canvas.page(5.2, 2.5)
        axes = figure.add_axes((0.115, 0.16, 0.6, 0.82))
        for place, function in enumerate(ncp.functions()):
            colour, marker, look = LOOKS[function.equation]
            residuals = [max(step.residual, 1e-16) for step in paths[function.equation]]
            axes.semilogy(residuals, color=colour, marker=marker, markersize=3.5, linewidth=1.2, linestyle=look)
            axes.text(1.03, 0.9 - 0.13 * place, f"{function.equation} {function.name.split(',')[0]}", color=colour,
                      transform=axes.transAxes, fontsize=7.5)  # fmt: skip
        axes.set_xlabel("step", labelpad=1)
        axes.set_ylabel("natural residual")
        axes.set_ylim(3e-17, 30)
        drawn = svg.inline(figure, "fig-race", "Residual by step for the four functions; the smooth one is slow")
    return Figure(
        drawn,
        text(
            "To the degenerate solution: three curves bend down, the residual of the smooth function falls by a "
            "factor a step."
        ),
        "Generalized Newton with four functions",
    )


def _slices() -> Figure:
    """½Φ² of one unknown."""
    example, line = hump(), np.linspace(-0.6, 1.9, 251)
    with canvas.drawing():
        figure = canvas.page(5.2, 2.2)
        axes = figure.add_axes((0.085, 0.175, 0.9, 0.8))
        for function, name in ((ncp.functions()[0], "minimum"), (ncp.functions()[1], "Fischer–Burmeister")):
            colour, _, look = LOOKS[function.equation]
            values = merit_slice(example, function, np.zeros(1), np.ones(1), line)
            axes.plot(line, values, color=colour, linewidth=1.6, linestyle=look)
            top = int(np.argmax(np.where((line > 0.4) & (line < 1.2), values, 0.0)))
            axes.annotate(name, (line[top], values[top]), xytext=(0, 4 if name == "minimum" else -17),
                          textcoords="offset points", color=colour, ha="center",
                          va="bottom" if name == "minimum" else "top")  # fmt: skip
        for solution in example.solutions:
            axes.plot(solution, [0.0], "o", color=canvas.RED, markersize=6, zorder=5, clip_on=False)
        axes.set_ylim(0.0, 0.75)
        axes.set_xlabel("$z$", labelpad=1)
        axes.set_ylabel(r"$\Psi(z)$")
        drawn = svg.inline(
            figure, "fig-merit", "Two merit functions between two zeros; that of the minimum has a corner"
        )
    return Figure(
        drawn,
        text(
            "For $F(z)=2-z^2$, with solutions $0$ and $\\sqrt2$: the merit of the minimum has a corner, the other is "
            "round."
        ),
        "Merit functions of one unknown",
    )
