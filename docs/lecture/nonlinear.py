"""Nonlinear programs: (10)-(12)."""

from __future__ import annotations

import numpy as np

from cpbench.foundation.matrices import Vector
from cpbench.report import canvas
from lecture import cells, svg
from lecture.blocks import Block, Figure, Heading, Section, Try, formula, table, text
from lecture.conversions import by_solvers, shown, trips
from lecture.formulas import maps
from lecture.numerics.examples import problems
from lecture.numerics.examples.nonlinear import hock_schittkowski_14, program_14
from lecture.numerics.newton import Iterate, josephy_newton


def section() -> Section:
    """(10)-(12)."""
    example = hock_schittkowski_14()
    path = josephy_newton(example, example.start)
    best = program_14(*example.solutions[0][:2])[0]
    last = path[-1].x
    rows = [
        (str(k), cells.vector(step.x[:2]), cells.number(program_14(*step.x[:2])[0]), cells.error(step.residual))
        for k, step in enumerate(path)
    ]
    return Section(
        "nonlinear",
        "Nonlinear programs",
        text("The same picture with bent walls. Optimality is still a complementarity problem, now a nonlinear one."),
        (
            text("Given differentiable $f$, $g$ and $h$, find"),
            formula(r"\begin{cases}\text{minimise}&f(z)\\\text{subject to}&g(z)\ge0\\&h(z)=0\end{cases}", 10),
            text("The Lagrangian prices the constraints as before,"),
            formula(r"\mathcal{L}(z,\lambda,\mu)=f(z)-\lambda^{\top}g(z)-\mu^{\top}h(z)", 11),
            text("and its stationary points with the right signs satisfy the conditions of Karush, Kuhn and Tucker:"),
            formula(
                r"\begin{cases}\nabla_z\mathcal{L}=\nabla f(z)-\nabla g(z)\,\lambda-\nabla h(z)\,\mu=0\\h(z)=0\\"
                r"0\le\lambda\perp g(z)\ge0\end{cases}",
                12,
            ),
            text(
                "They are necessary where a constraint qualification holds, and sufficient when the program is convex. "
                "Our example is problem 14 of a well-known collection[^hock]: "
                "$f=(x-2)^2+(y-1)^2$, $g=1-\\tfrac14x^2-y^2$, $h=x-2y+1$."
            ),
            _picture(path, last),
            text(
                "Newton's method for (12) keeps the inequality and replaces the functions by their tangents. Each "
                "step is then a mixed *linear* problem (14), which the library converts by a Schur complement and "
                "solves by Lemke's method. This is Josephy's idea[^josephy]; we come back to it at (21)."
            ),
            table(
                ("step", "$(x, y)$", "$f$", "residual of (12)"),
                rows,
                "The residual falls with the square of the one before. The published minimiser has $f=9-2.875\\sqrt7$ "
                "= «published»; the last step differs from it by «off».",
                published=best,
                off=abs(program_14(*last[:2])[0] - best),
            ),
            *_nodes(),
        ),
    )


def _nodes() -> tuple[Block, ...]:
    """The program as a problem of the library, and what it is converted to."""
    program, letters = problems()["program"], ("x", "y")
    return (
        Heading("The program as data"),
        text(
            "The library holds $f$, $g$ and $h$ as lists of operations, with exact derivatives. From them it writes "
            "the conditions (12), as a mixed complementarity problem (21) or as an inclusion (30):"
        ),
        maps(program, "f", "g", "h", unknowns=letters, of="x,y"),
        maps(problems()["program-conditions"], "F", unknowns=(*letters, "\\lambda", "\\mu"), of="x,y,\\lambda,\\mu"),
        *shown(
            [*trips("program", "nlp-micp", "nlp-ge"), *trips("qp", "qp-nlp"), *trips("linear-nlp", "nlp-qp")],
            "The program of the first section goes to this one and back.",
        ),
        text(
            "Newton's linearisation is a conversion too, and says that it errs. From the point inside where the "
            "program starts, one step goes this far:"
        ),
        *shown(trips("program-conditions", "micp-mlcp")),
        by_solvers("program", "scipy-slsqp", "scipy-trust-constr", "casadi-ipopt-nlp", "casadi-sqpmethod"),
        Try(
            (
                "cpbench solve problems.h5::program --solver scipy-slsqp",
                "cpbench solve problems.h5::program --solver josephy-newton",
                "cpbench convert problems.h5::program conditions.h5 --to micp",
            )
        ),
    )


def _picture(path: list[Iterate], last: Vector) -> Figure:
    """Circles of f, the ellipse, the line, the iterates."""
    with canvas.drawing():
        figure = canvas.page(5.2, 2.75)
        axes = figure.add_axes((0.075, 0.13, 0.905, 0.85))
        x, y = np.meshgrid(np.linspace(-2.4, 3.0, 241), np.linspace(-1.25, 2.2, 161))
        objective, ellipse, line = program_14(x, y)
        levels = [0.35, float(program_14(*last[:2])[0]), 3.5, 7.0, 12.0]
        axes.contour(x, y, objective, levels, colors=canvas.GREY, linewidths=0.7)
        axes.contourf(x, y, ellipse, [-1e9, 0.0], colors=[canvas.FAINT], alpha=0.75)
        axes.contour(x, y, ellipse, [0.0], colors=canvas.INK, linewidths=1.3)
        axes.contour(x, y, line, [0.0], colors=canvas.BLUE, linewidths=1.6)
        steps = np.array([step.x[:2] for step in path])
        axes.plot(*steps.T, color=canvas.RED, linewidth=1.0, marker="o", markersize=3.5)
        axes.plot(*last[:2], "o", color=canvas.RED, markersize=7, zorder=5)
        axes.text(2.6, 1.55, r"$h = 0$", color=canvas.BLUE, ha="center", va="center")
        axes.text(-0.5, -0.45, r"$g \geq 0$", ha="center")
        axes.text(steps[0, 0] + 0.1, steps[0, 1], "start", color=canvas.RED, va="center")
        axes.set_aspect("equal")
        axes.set_xlabel("$x$", labelpad=1)
        axes.set_ylabel("$y$", labelpad=1)
        drawn = svg.inline(
            figure, "fig-nlp", "An ellipse, a line through it, circles of the objective, and a path of steps"
        )
    return Figure(
        drawn,
        text(
            "Circles: $f$. Not shaded: $g\\ge0$. The minimiser is where the line leaves the ellipse; the red path "
            "is that of the method below."
        ),
        "Problem 14 with the steps of Newton's method",
    )
