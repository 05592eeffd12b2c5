"""Friction without facets: the direct formulation (49), the cone, and convex programs with something frozen."""

from __future__ import annotations

import numpy as np

from cpbench import FrictionContact
from cpbench.foundation.cones import de_saxce
from cpbench.report import canvas
from lecture import cells, friction_cone, svg
from lecture.blocks import Block, Figure, Heading, Section, Try, aside, formula, text
from lecture.conversions import registered, shown, trips
from lecture.numerics.examples import problems
from lecture.numerics.friction import direct_law, fixed_point
from lecture.numerics.round_trips import answer


def section() -> Section:
    """(49) and the cone."""
    problem = problems()["sliding"]
    assert isinstance(problem, FrictionContact)
    return Section(
        "friction",
        "Friction as it is",
        text("No facets: either two equations that are not linear, or a cone that is not its own dual."),
        (*_direct(problem), *_cone(problem), *_frozen(problem)),
    )


def _direct(problem: FrictionContact) -> tuple[Block, ...]:
    found = answer(problem)
    r, u, mu = found.point.r, problem.slacks(found.point)["u"], float(problem.mu[0])
    at = direct_law(r, u, mu)
    odd = direct_law(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), mu, xi=0.0)
    return (
        text(
            "Let $\\xi=\\|u_{\\mathrm T}\\|$ be the speed of sliding and $\\sigma=\\mu r_{\\mathrm N}-\\|r_{\\mathrm "
            "T}\\|$ what is left of the threshold. One of them is zero, and while sliding the impulse is opposite to "
            "the velocity:"
        ),
        formula(
            r"\begin{cases}r_{\mathrm T}\,\xi+\|r_{\mathrm T}\|\,u_{\mathrm T}=0\\\xi(u_{\mathrm T})\ge0,\quad"
            r"\sigma(r_{\mathrm T})\ge0,\quad\sigma(r_{\mathrm T})\,\xi(u_{\mathrm T})=0\end{cases}",
            49,
        ),
        text(
            "At the answer of the contact above the first line is «first», $\\sigma$ is «sigma» and the product "
            "«product».",
            first=cells.error(at.printed), sigma=cells.error(abs(at.sigma)), product=cells.error(abs(at.product)),
        ),
        aside(
            "When ξ is an unknown of its own",
            text(
                "A solver of (49) has $\\xi$ among its unknowns, and then (49) has answers that no floor gives: "
                "$r_{\\mathrm T}=0$, $r_{\\mathrm N}>0$, $u_{\\mathrm T}\\ne0$ and $\\xi=0$ leave «printed» of the "
                "first line. With $\\mu r_{\\mathrm N}$ for $\\|r_{\\mathrm T}\\|$ there, «mended» is left, and the "
                "answer is no longer one.",
                printed=odd.printed, mended=odd.mended,
            ),
        ),
        text(
            "The lecture's two complaints stand: all of it is nonlinear, and it is hard to say which $F$ of (19) it "
            "belongs to. The library makes it a mixed problem (21) all the same, in a form that is regular where a "
            "contact opens:"
        ),
        *shown([*trips("sliding", "fc-micp"), *trips("plane", "fc-micp")]),
    )  # fmt: skip


def _cone(problem: FrictionContact) -> tuple[Block, ...]:
    found = answer(problem)
    r, u = found.point.r, problem.slacks(found.point)["u"]
    hat = de_saxce(u[None, :], problem.mu)[0]
    alt = "The cone of friction with the impulse on it, the velocity, and the changed velocity at a right angle"
    with canvas.drawing():
        drawn = svg.inline(friction_cone.draw(problem, found.point.r), "fig-cone", alt)
    return (
        Heading("One cone for all"),
        text(
            "De Saxcé and Feng[^saxce] lift the velocity by $\\mu\\|u_{\\mathrm T}\\|$ along the normal. Then "
            "Signorini's and Coulomb's laws are one complementarity problem (17) over the cone of friction:"
        ),
        formula(
            r"K^{*}_{\mu}\ni\hat u\perp r\in K_{\mu},\qquad\hat u=u+\mu\|u_{\mathrm T}\|e_{\mathrm N},\qquad "
            r"K_{\mu}=\left\{r:\|r_{\mathrm T}\|\le\mu r_{\mathrm N}\right\}",
            label="as (17)",
        ),
        Figure(
            drawn,
            text("The impulse $r$ is on the cone, $\\hat u$ on the dual one, and they meet at a right angle."),
            alt,
        ),
        text("Measured: $r^{\\top}\\hat u$ = «product», while $r^{\\top}u$ = «work» is the work of friction.",
             product=cells.error(abs(float(r @ hat))), work=float(r @ u)),
        text(
            "So friction is a cone problem, a variational inequality over the cone, or one over a set that moves: the "
            "disk whose radius is $\\mu r_{\\mathrm N}$."
        ),
        *shown(trips("sliding", "fc-cp", "fc-vi", "fc-qvi")),
    )  # fmt: skip


def _frozen(problem: FrictionContact) -> tuple[Block, ...]:
    paths = {
        r"$\mu\,\|u_\mathrm{T}\|$ frozen": [step.error for step in fixed_point(problem, "fc-coneqp")],
        r"$\mu\,r_\mathrm{N}$ frozen": [step.error for step in fixed_point(problem, "fc-coneqp-tresca")],
    }
    return (
        Heading("Freeze, solve, thaw"),
        text(
            "The lifted term is what makes friction nonconvex. Hold it at some number and a convex program is left, "
            "at zero the relaxation of Anitescu and Tasora[^tasora], in which sliding contacts open. Or hold the "
            "threshold $\\mu r_{\\mathrm N}$, after Tresca: the cone becomes a cylinder."
        ),
        *shown(
            [
                *trips("sliding", "fc-coneqp", "fc-soclcp", "fc-coneqp-tresca", "fc-coneqp-compliant"),
                *trips("dumbbell", "gfc-coneqp"),
            ],
            "The errors here are honest: these are relaxations, which drop a term of the law.",
        ),
        text("Put the number that came out back in, and again: both fixed points end at the law itself[^cadoux]."),
        _thaw(paths),
        text("Registered for the law itself: «all».", all=registered("fc")),
        Try(
            (
                "cpbench solve problems.h5::sliding --solver nsgs",
                "cpbench solve problems.h5::sliding --solver newton-qvi",
                "cpbench convert problems.h5::sliding sliding-as-program.h5 --to coneqp --via fc-coneqp",
            )
        ),
    )


def _thaw(paths: dict[str, list[float]]) -> Figure:
    """Error on the law by step of the fixed points."""
    with canvas.drawing():
        figure = canvas.page(5.2, 2.3)
        axes = figure.add_axes((0.115, 0.175, 0.86, 0.8))
        looks = ((canvas.BLUE, "o", "-"), (canvas.RED, "D", (0, (4, 2))))
        for place, ((name, errors), (colour, marker, look)) in enumerate(zip(paths.items(), looks, strict=True)):
            axes.semilogy([max(e, 1e-17) for e in errors], color=colour, marker=marker, markersize=3.5, linewidth=1.2,
                          linestyle=look)  # fmt: skip
            axes.text(0.97, 0.92 - 0.12 * place, name, color=colour, ha="right", va="top", transform=axes.transAxes)
        axes.set_xlabel("steps", labelpad=1)
        axes.set_ylabel("error on the law")
        drawn = svg.inline(figure, "fig-thaw", "Errors of two fixed points fall to rounding")
    return Figure(
        drawn,
        text("Each mark is a convex program solved. Step 0 is the relaxation alone."),
        "Convergence of two fixed points",
    )
