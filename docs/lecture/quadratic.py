"""Quadratic programs: the problem (1), its Lagrangian (2), its conditions (3), its dual (4)-(9)."""

from __future__ import annotations

from typing import Any

import numpy as np

from cpbench import QP, QPPoint
from cpbench.report import canvas
from lecture import svg
from lecture.blocks import Block, Figure, Heading, Section, Try, aside, formula, text
from lecture.conversions import by_solvers, data, registered, shown, trips
from lecture.numerics.examples import problems
from lecture.numerics.lagrangian import dual_along, dual_function, lagrangian, objective_over
from lecture.numerics.round_trips import Answer, answer


def section() -> Section:
    """(1)-(9)."""
    known = problems()
    qp, twice = known["qp"], known["qp-repeated"]
    assert isinstance(qp, QP)
    assert isinstance(twice, QP)
    found = answer(qp)
    return Section(
        "quadratic",
        "Quadratic programs",
        text("The problem that everything else in the lecture leans on: a bowl, cut off by straight walls."),
        (*_problem(qp, found), *_conditions(qp, found), *_dual(qp, found), *_degenerate(qp, twice, found), *_solve()),
    )


def _problem(qp: QP, found: Answer) -> tuple[Block, ...]:
    z = found.point.z
    return (
        text(
            "Let $Q$ be symmetric. A *quadratic program* asks for the lowest point of a quadratic function where some "
            "linear functions are not negative and others are zero."
        ),
        formula(
            r"\begin{cases}\text{minimise}&q(z)=\tfrac12 z^{\top}Qz+p^{\top}z\\"
            r"\text{subject to}&Az-b\ge0\\&Cz-d=0\end{cases}",
            1,
        ),
        text("Ours has two unknowns, so that we can see it: two walls and one line to stay on."),
        data(qp, "Q", "p", "A", "b", "C", "d"),
        _valley(qp, z),
        text(
            "Each constraint gets a price, the multipliers $\\lambda\\ge0$ and $\\mu$. Paying for violations instead "
            "of forbidding them turns the program into one function:"
        ),
        formula(r"\mathcal{L}(z,\lambda,\mu)=\tfrac12 z^{\top}Qz+p^{\top}z-\lambda^{\top}(Az-b)-\mu^{\top}(Cz-d)", 2),
        text(
            "At the minimiser no price is paid for nothing: $\\mathcal{L}$ = «L», and the objective is «q».",
            L=lagrangian(qp, z, found.point.lam, found.point.mu),
            q=qp.objective(z),
        ),
    )


def _conditions(qp: QP, found: Answer) -> tuple[Block, ...]:
    judged = qp.residuals(found.point).measured
    return (
        Heading("First-order conditions"),
        text(
            "Where the bowl's slope is balanced by the prices, and a price is paid only at a wall that is touched, we "
            "are done. These are the conditions of Karush, Kuhn and Tucker, a mixed linear complementarity problem:"
        ),
        formula(
            r"\begin{cases}\nabla_z\mathcal{L}(\bar z,\lambda,\mu)=Q\bar z+p-A^{\top}\lambda-C^{\top}\mu=0\\"
            r"C\bar z-d=0\\0\le\lambda\perp A\bar z-b\ge0\end{cases}",
            3,
        ),
        text(
            "Here $\\bar z$ = «z», $\\lambda$ = «lam», $\\mu$ = «mu», by `«by»`. The four numbers that judge it: "
            "stationarity «stationarity», primal «primal», dual «dual», gap «gap».",
            z=found.point.z,
            lam=found.point.lam,
            mu=found.point.mu,
            by=found.by,
            **judged,
        ),
        *shown(trips("qp", "qp-mlcp", "qp-avi", "qp-coneqp", "qp-qp-dual")),
    )


def _dual(qp: QP, found: Answer) -> tuple[Block, ...]:
    point = found.point
    away = dual_function(qp, 0.5 * point.lam + 0.25, point.mu + 1.0)
    at = dual_function(qp, point.lam, point.mu)
    return (
        Heading("The dual"),
        text(
            "The program is a game: $z$ makes $\\mathcal{L}$ small, the prices make it large, for a violated "
            "constraint is worth any price."
        ),
        formula(r"\min_{z}\;\max_{\lambda\ge0,\,\mu}\;\mathcal{L}(z,\lambda,\mu)", 4),
        text("Let the prices move first, and $z$ answer:"),
        formula(r"\theta(\lambda,\mu)=\min_{z}\;\mathcal{L}(z,\lambda,\mu)", 5),
        formula(r"\max_{\lambda\ge0,\,\mu}\;\theta(\lambda,\mu)", 6),
        text("When $Q$ can be inverted the answer of $z$ is a formula, and so is $\\theta$:"),
        formula(
            r"\begin{split}\theta(\lambda,\mu)&=\mathcal{L}\left(Q^{-1}(A^{\top}\lambda+C^{\top}\mu-p),\lambda,"
            r"\mu\right)"
            r"\\&="
            r"-\tfrac12(A^{\top}\lambda+C^{\top}\mu-p)^{\top}Q^{-1}(A^{\top}\lambda+C^{\top}\mu-p)+b^{\top}\lambda+d^{\top}\mu\end{split}",
            7,
            8,
        ),
        text(
            "At prices taken at random the two lines give «first» and «second», both below the optimal value: *weak "
            "duality*. At the optimal prices they give «at».",
            first=away.at_minimiser,
            second=away.closed,
            at=at.closed,
        ),
        formula(
            r"\max_{\lambda\ge0,\,\mu}"
            r"\;-\tfrac12(A^{\top}\lambda+C^{\top}\mu-p)^{\top}Q^{-1}(A^{\top}\lambda+C^{\top}\mu-p)+b^{\top}\lambda+d^{\top}\mu",
            9,
        ),
        text(
            "This is again a quadratic program, whose only inequalities are signs; the conversion `qp-qp-dual` makes "
            "it. *Strong duality* says that the gap closes. Measured: «gap».",
            gap=abs(at.closed - qp.objective(point.z)),
        ),
        _hill(qp, point),
    )


def _degenerate(qp: QP, twice: QP, found: Answer) -> tuple[Block, ...]:
    lam = found.point.lam
    splits = [np.array([share, 1.0 - share]) * lam[0] for share in (1.0, 0.25)]
    errors = [
        twice.residuals(QPPoint(z=found.point.z, lam=one, mu=found.point.mu, nu=found.point.nu)).error for one in splits
    ]
    return (
        aside(
            "When things degenerate",
            text(
                "Write the active wall twice. The minimiser stays, the prices are no longer unique: $\\lambda$ = «one» "
                "has error «first», $\\lambda$ = «other» has «second». That is why an answer is judged by residuals, "
                "never by its distance to another answer.",
                one=splits[0], other=splits[1], first=errors[0], second=errors[1],
            ),
            text(
                "The other two cases of the lecture: $Q$ only semidefinite, where a minimiser may not exist, and "
                "$\\lambda_i=0$ at a wall that is touched, where strict complementarity fails[^fletcher93]."
            ),
        ),
    )  # fmt: skip


def _solve() -> tuple[Block, ...]:
    return (
        Heading("Methods"),
        text(
            "Active sets[^fletcher87] guess which walls are touched; interior points[^bonnans] walk through the "
            "middle; splitting methods alternate between bowl and walls."
        ),
        by_solvers("qp", "daqp", "clarabel", "osqp"),
        text("Registered for this formulation: «all».", all=registered("qp")),
        Try(
            (
                "cpbench info problems.h5::qp --data",
                "cpbench solve problems.h5::qp --solver daqp",
                "cpbench convert problems.h5::qp qp-as-mlcp.h5 --to mlcp",
                "cpbench graph problems.h5::qp --to lcp",
            )
        ),
    )


def _valley(qp: QP, z: Any) -> Figure:
    """Contours, feasible set, minimisers."""
    with canvas.drawing():
        figure = canvas.page(5.2, 3.1)
        axes = figure.add_axes((0.075, 0.11, 0.905, 0.87))
        across, up = np.linspace(-0.6, 2.9, 181), np.linspace(-0.25, 2.45, 181)
        x, y = np.meshgrid(across, up)
        levels = qp.objective(z) + np.array([-1.4, -0.7, 0.0, 1.5, 4.0, 8.0])
        axes.contour(
            x, y, objective_over(qp, x, y), sorted(levels), colors=canvas.GREY, linewidths=0.7, linestyles="solid"
        )
        walls = qp.A @ np.array([x.ravel(), y.ravel()])
        for row in range(len(qp.b)):
            slack = (walls[row] - qp.b[row]).reshape(x.shape)
            axes.contourf(x, y, slack, [-1e9, 0.0], colors=[canvas.FAINT], alpha=0.75)
            axes.contour(x, y, slack, [0.0], colors=canvas.INK, linewidths=1.3)
        stay = (qp.C @ np.array([x.ravel(), y.ravel()]) - qp.d[:, None]).reshape(x.shape)
        axes.contour(x, y, stay, [0.0], colors=canvas.BLUE, linewidths=1.6)
        free = np.linalg.solve(np.asarray(qp.Q), -qp.p)
        axes.plot(*free, "o", markerfacecolor="none", markeredgecolor=canvas.INK, markersize=6)
        axes.plot(*z, "o", color=canvas.RED, markersize=7, zorder=5)
        axes.annotate("minimiser without walls", free, xytext=(10, 4), textcoords="offset points", va="center")
        axes.annotate(
            r"$\bar{z}$", z, xytext=(-13, -1), textcoords="offset points", ha="right", color=canvas.RED, fontsize=10
        )
        axes.text(1.13, 2.2, r"$Cz = d$", color=canvas.BLUE, ha="right", va="center")
        axes.text(2.2, 0.55, r"forbidden by $Az \geq b$", ha="center", va="center")
        axes.set_aspect("equal")
        axes.set_xlabel("$z_1$", labelpad=1)
        axes.set_ylabel("$z_2$", labelpad=1)
        drawn = svg.inline(figure, "fig-valley", "Contours of a quadratic, shaded walls, and the minimiser on a corner")
    told = text(
        "Grey ovals: $q(z)$. Shaded: where an inequality fails. The answer is where the blue line meets the wall, "
        "on the oval $q$ = «q».",
        q=qp.objective(z),
    )
    return Figure(drawn, told, "Contours of the quadratic program with its walls")


def _hill(qp: QP, point: Any) -> Figure:
    """θ along λ₁ below the optimal value."""
    with canvas.drawing():
        figure = canvas.page(5.2, 2.1)
        axes = figure.add_axes((0.13, 0.19, 0.855, 0.78))
        prices = np.linspace(0.0, 2.0 * point.lam[0], 121)
        axes.plot(prices, dual_along(qp, point.lam, point.mu, 0, prices), color=canvas.BLUE, linewidth=1.8)
        best = qp.objective(point.z)
        axes.axhline(best, color=canvas.INK, linewidth=1.0, linestyle=(0, (4, 2)))
        axes.plot(point.lam[0], best, "o", color=canvas.RED, markersize=6, zorder=5)
        axes.annotate(
            r"optimal value of the program", (0.02 * prices[-1], best), xytext=(0, 3), textcoords="offset points"
        )
        axes.set_xlabel(r"$\lambda_1$, the other multipliers at their optimum", labelpad=1)
        axes.set_ylabel(r"$\theta$")
        axes.margins(y=0.18)
        axes.annotate(r"$\theta(\lambda_1)$", (prices[15], dual_along(qp, point.lam, point.mu, 0, prices[15:16])[0]),
                      xytext=(9, -3), textcoords="offset points", color=canvas.BLUE)  # fmt: skip
        drawn = svg.inline(figure, "fig-hill", "The dual function is a hill whose top touches the optimal value")
    told = text(
        "The dual function never rises above the optimal value, and touches it at $\\lambda_1$ = «lam».",
        lam=point.lam[0],
    )
    return Figure(drawn, told, "The dual function along one price")
