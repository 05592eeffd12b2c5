"""Cones, nonlinear and mixed complementarity: (17)-(21)."""

from __future__ import annotations

import numpy as np

from cpbench import make
from cpbench.report import canvas
from lecture import cells, svg
from lecture.blocks import Block, Figure, Heading, Section, Table, Try, formula, table, text
from lecture.conversions import by_solvers, data, shown, trips
from lecture.formulas import maps
from lecture.numerics.examples import problems
from lecture.numerics.examples.maps import four_unknowns
from lecture.numerics.examples.nonlinear import hock_schittkowski_14, kojima_shindo
from lecture.numerics.inequalities import cone_products
from lecture.numerics.newton import josephy_newton
from lecture.numerics.round_trips import answer, outcome

MU = 0.5


def section() -> Section:
    """(17)-(21)."""
    return Section(
        "cones",
        "Cones and nonlinear maps",
        text("Replace the orthant by a cone and the matrix by a map: the question stays the same."),
        (*_cone(), *_nonlinear(), *_mixed()),
    )


def _cone() -> tuple[Block, ...]:
    problem = problems()["soclcp"]
    found = answer(problem)
    x, w = found.point.x, problem.slacks(found.point)["w"]
    return (
        text("Given a cone $K$ and a map $F$, the *complementarity problem* is to find $x$ with"),
        formula(r"K\ni x\perp F(x)\in K^{*}", 17),
        text("where the dual cone holds the directions that make no obtuse angle with any of $K$:"),
        formula(r"K^{*}=\left\{d\in\mathbb{R}^{n}:\;v^{\top}d\ge0\;\;\forall\,v\in K\right\}", 18),
        _dual(),
        text(
            "The orthant is its own dual, so (13) is a case of (17). The cone of friction is not: with coefficient "
            "$\\mu$ it opens by $\\mu$, its dual by $1/\\mu$. An affine map over a second-order cone in space:"
        ),
        data(problem, "M", "q"),
        text(
            "The answer $x$ = «x» lies on the cone, $Mx+q$ = «w» on the dual one, and their product is «product».",
            x=x,
            w=w,
            product=abs(float(x @ w)),
        ),
        *shown([*trips("soclcp", "soclcp-coneqp", "soclcp-cp"), *trips("coneqp", "coneqp-soclcp")]),
        text("A map that is not affine over the same cone, and the affine one in the same dress:"),
        maps(problems()["cubic-cone"], "F", of="x", unknowns=("x_{1}", "x_{2}", "x_{3}")),
        *shown([*trips("cubic-cone", "cp-vi"), *trips("linear-cp", "cp-soclcp")]),
        Try(
            (
                "cpbench solve problems.h5::soclcp --solver newton-soclcp",
                "cpbench convert problems.h5::soclcp soclcp-as-program.h5 --to coneqp",
            )
        ),
    )


def _nonlinear() -> tuple[Block, ...]:
    example = kojima_shindo()
    rows = []
    for start in (example.start, np.array([1.5, 0.0, 0.0, 0.0]), np.zeros(4)):
        path = josephy_newton(example, start)
        rows.append((cells.vector(start), cells.vector(path[-1].x), str(len(path) - 1), cells.error(path[-1].residual)))
    return (
        Heading("Nonlinear complementarity"),
        text("With the orthant for $K$, and $F$ not affine:"),
        formula(r"0\le z\perp F(z)\ge0", 19),
        text(
            "The usual test has four unknowns and two solutions[^kojima], $(\\tfrac12\\sqrt6,0,0,\\tfrac12)$ and "
            "$(1,0,3,0)$. At the first one $z_3$ and $F_3$ are both zero. Linearise and solve an LCP, again and again:"
        ),
        table(
            ("from", "to", "steps", "residual"),
            rows,
            "Josephy's method. Where the residual is large, a linear problem on the way had no solution, and the "
            "method stopped. It does not come to the degenerate solution; methods of the section after next do.",
        ),
        maps(problems()["kojima-shindo"], "F"),
        *shown([*trips("kojima-shindo", "ncp-micp"), *trips("lcp", "lcp-ncp"), *trips("linear-ncp", "ncp-lcp")]),
        _both(),
    )


def _both() -> Table:
    """Each published start by solvers of the library, on the problem as data."""
    rows = []
    for start in (np.array([1.0, 0.0, 0.0, 0.0]), np.array([1.0, 0.0, 1.0, 0.0]), np.ones(4)):
        problem = make("ncp-micp").apply(four_unknowns(start))[0]
        found = [outcome(problem, solver) for solver in ("josephy-newton", "path-search", "newton-fb-micp")]
        rows.append((cells.vector(start), *(cells.vector(z) if z is not None else "stops" for z in found)))
    return table(
        ("from", "`josephy-newton`", "`path-search`", "`newton-fb-micp`"),
        rows,
        "The same problem by solvers of the library, which do not stop where a linear problem has no solution. Both "
        "solutions are found; which one, the start and the method say.",
    )


def _mixed() -> tuple[Block, ...]:
    example = hock_schittkowski_14()
    path = josephy_newton(example, example.start)
    n = example.free
    return (
        Heading("Mixed complementarity"),
        text("Equations for free unknowns $u$ stand beside complementary ones $v$, as in (14) but nonlinear:"),
        formula(r"\begin{cases}G(u,v)=0\\0\le v\perp H(u,v)\ge0\end{cases}", 20),
        text(
            "One may also keep one vector and split its indices into free ones, $\\mathsf F$, and constrained ones, "
            "$\\mathsf C$:"
        ),
        formula(
            r"\begin{cases}F_{\mathsf F}(z)=0,\quad z_{\mathsf F}\ \text{free}"
            r"\\0\le z_{\mathsf C}\perp F_{\mathsf C}(z)\ge0\end{cases}",
            21,
        ),
        text(
            "The conditions (12) are of this form, with $(z,\\mu)$ free and $\\lambda$ constrained. For problem 14 the "
            "unknowns end at $(x,y,\\mu)$ = «free» and $\\lambda$ = «lam» after «steps» linear problems.",
            free=path[-1].x[:n],
            lam=path[-1].x[n:],
            steps=len(path) - 1,
        ),
        *shown(trips("mlcp", "mlcp-micp"), "The mixed linear problem (14) is the case of an affine map."),
        by_solvers("program-conditions", "josephy-newton", "path-search", "newton-normal-map", "newton-min-micp"),
        Try(
            (
                "cpbench solve problems.h5::kojima-shindo --solver path-search",
                "cpbench solve problems.h5::cubic-cone --solver newton-vi",
                "cpbench graph problems.h5::kojima-shindo --to equation",
            )
        ),
        text(
            "The lecture's two ways to go on: linearise the map and solve linear problems, as here, or rewrite the "
            "conditions as one nonsmooth equation."
        ),
    )


def _dual() -> Figure:
    """K and K* in the plane."""
    with canvas.drawing():
        figure = canvas.page(5.2, 2.4)
        axes = figure.add_axes((0.02, 0.02, 0.96, 0.96))
        reach = 2.0
        for slope, colour, zorder in ((1.0 / MU, canvas.GREEN, 1), (MU, canvas.BLUE, 2)):
            corner = np.array([[0.0, slope, -slope], [0.0, 1.0, 1.0]]) * reach
            axes.fill(*corner, color=colour, alpha=0.16, zorder=zorder, linewidth=0)
            axes.plot(corner[0, [1, 0, 2]], corner[1, [1, 0, 2]], color=colour, linewidth=1.8, zorder=zorder + 2)
        edge, across = np.array([MU, 1.0]), np.array([-1.0 / MU, 1.0])
        for way, name, colour, aside in ((edge, "$v$", canvas.BLUE, 0.16), (across, "$d$", canvas.GREEN, 0.0)):
            tip = way / np.linalg.norm(way)
            axes.annotate(
                "",
                (tip[0], tip[1]),
                (0, 0),
                arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 2.0},
                zorder=6,
            )
            axes.text(tip[0] + aside, tip[1] + 0.14 - aside, name, color=colour, fontsize=10, ha="center", va="center")
        small = 0.14
        one, other = small * edge / np.linalg.norm(edge), small * across / np.linalg.norm(across)
        corner = np.array([one, one + other, other]).T
        axes.plot(*corner, color=canvas.INK, linewidth=0.9, zorder=7)
        axes.text(0.0, 1.45, "$K$", color=canvas.BLUE, fontsize=12, ha="center")
        axes.text(2.1, 1.45, "$K^*$", color=canvas.GREEN, fontsize=12, ha="center")
        axes.set_xlim(-3.2, 3.2)
        axes.set_ylim(-0.12, 1.85)
        axes.set_aspect("equal")
        axes.set_axis_off()
        drawn = svg.inline(
            figure, "fig-dual", "A narrow cone inside its wide dual cone; their edges meet at right angles"
        )
    return Figure(
        drawn,
        text(
            "$K$ with $\\mu$ = «mu» inside its dual. An edge of $K$ is at a right angle to an edge of $K^{*}$: the "
            "least product of unit vectors of both is «least».",
            mu=MU,
            least=abs(cone_products(MU, 1.0 / MU)),
        ),
        "A cone and its dual",
    )
