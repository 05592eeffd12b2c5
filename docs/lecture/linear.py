"""Linear complementarity: (13)-(16)."""

from __future__ import annotations

from cpbench import LCP
from cpbench.report import canvas
from lecture import cells, lcp_cones, svg
from lecture.blocks import Block, Figure, Heading, Section, Text, Try, aside, formula, table, text
from lecture.conversions import by_solvers, data, registered, shown, trips
from lecture.numerics.complementary_cones import complementary_cones, is_p_matrix, solutions
from lecture.numerics.examples import problems
from lecture.numerics.friction import inner_product_conditions
from lecture.numerics.round_trips import answer, refusal, round_trip


def section() -> Section:
    """(13)-(16)."""
    return Section(
        "linear",
        "Linear complementarity",
        text("Two nonnegative vectors, tied by a matrix, that are never positive in the same place."),
        (*_problem(), *_matrices(), *_mixed(), *_quadratic(), *_methods()),
    )


def _problem() -> tuple[Block, ...]:
    lcp = problems()["lcp"]
    found = answer(lcp)
    return (
        text("Given $M$ and $q$, the *linear complementarity problem* is to find $z$ with"),
        formula(r"0\le z\perp Mz+q\ge0", 13),
        text(
            "where $x\\perp y$ means $x^{\\top}y=0$. As both are nonnegative, in every row at least one of $z_i$ and "
            "$w_i=(Mz+q)_i$ is zero: with $n$ rows there are $2^n$ ways to choose, and the question is which."
        ),
        data(lcp, "M", "q"),
        text("Lemke's method finds $z$ = «z», with $w$ = «w».", z=found.point.z, w=lcp.slacks(found.point)["w"]),
        _cones("lcp", text(
            "Left: each choice is a cone in the plane of $q$, and $q$ lies in the one whose choice is right. Lemke's "
            "method slides down the line $q+z_0e$ until it gets there. Right: the same steps in the plane of $z$."
        )),
        *shown(trips("lcp", "lcp-avi", "lcp-mlcp", "lcp-qp", "lcp-qp-nonsymmetric")),
    )  # fmt: skip


def _matrices() -> tuple[Block, ...]:
    known = problems()
    rows = []
    for name in ("lcp", "lcp-nonsymmetric", "lcp-three"):
        problem = known[name]
        assert isinstance(problem, LCP)
        different = solutions(complementary_cones(problem))
        listed = " and ".join(f"«{name}{k}»" for k in range(len(different)))
        rows.append(
            (f"`{name}`", "yes" if is_p_matrix(problem) else "no", str(len(different)), listed, different, name)
        )
    values = {f"{row[5]}{k}": z for row in rows for k, z in enumerate(row[4])}
    return (
        Heading("How many solutions?"),
        text(
            "Exactly one for every $q$ if and only if $M$ is a *P-matrix*, all of whose principal minors are "
            "positive[^cottle][^murty]; positive definite matrices are, symmetric or not. Without that the cones "
            "overlap or leave gaps, and in general the problem is NP-hard."
        ),
        table(
            ("problem", "P-matrix", "solutions", "which"),
            [row[:4] for row in rows],
            "All complementary cones that contain $q$, enumerated.",
            **values,
        ),
        _cones("lcp-three", text(
            "No P-matrix: $q$ lies in three cones at once, and has three solutions (circles). Lemke's method finds one."
        )),
    )  # fmt: skip


def _mixed() -> tuple[Block, ...]:
    known = problems()
    singular = known["mlcp-singular"]
    why = refusal(singular, "mlcp-lcp-schur")
    return (
        Heading("Free unknowns beside"),
        text("The *mixed* problem has equations for unknowns of any sign:"),
        formula(r"\begin{cases}Au+Cv+a=0\\0\le v\perp Du+Bv+b\ge0\end{cases}", 14),
        data(known["mlcp"], "A", "C", "a"),
        data(known["mlcp"], "D", "B", "b"),
        text(
            "If $A$ can be inverted, $u$ is eliminated and an LCP is left, with $M=B-DA^{-1}C$ and $q=b-DA^{-1}a$. "
            "Otherwise each free unknown is written as a difference of two nonnegative ones."
        ),
        *shown(trips("mlcp", "mlcp-lcp-schur", "mlcp-lcp-split")),
        aside(
            "When the inverse is not there",
            text(
                "Two nodes, a resistor between them, a diode from one to ground. Without the diode nothing fixes the "
                "potentials, so $A$ is singular:"
            ),
            data(singular, "A", "C", "a"),
            text("`mlcp-lcp-schur` says no, and why: «why».", why=why),
            text(
                "`mlcp-lcp-split` does not mind: potentials «u» V, a diode current of «v» A, error «error».",
                **_split(),
            ),
        ),
    )


def _split() -> dict[str, object]:
    trip = round_trip(problems()["mlcp-singular"], "mlcp-lcp-split")
    return {**trip.lifted.arrays(), "error": cells.error(trip.source_error)}


def _quadratic() -> tuple[Block, ...]:
    lcp = problems()["lcp-nonsymmetric"]
    assert isinstance(lcp, LCP)
    trip = round_trip(lcp, "lcp-qp-nonsymmetric")
    z = trip.lifted.arrays()["z"]
    held = inner_product_conditions(lcp, z, z)
    return (
        Heading("The way back to quadratic programs"),
        text(
            "For $M$ symmetric and positive semidefinite, (13) is the optimality condition of $\\tfrac12z^{\\top}Mz+"
            "q^{\\top}z$ over $z\\ge0$. For any other $M$ one may minimise the product that should vanish:"
        ),
        formula(
            r"\begin{cases}\text{minimise}&z^{\top}(q+Mz)\\\text{subject to}&q+Mz\ge0\\&z\ge0\end{cases}", 15
        ),
        text(
            "In the letters of (1): $Q=M+M^{\\top}$, $p=q$, and the rows of $M$ and $I$ for $A$. A $z$ solves the LCP "
            "exactly when the optimal value is zero. Here it is «value».",
            value=held.objective,
        ),
        data(lcp, "M", "q"),
        text("Its optimality conditions, with the multiplier $\\mu$ of $Mz+q\\ge0$, are again complementary:"),
        formula(
            r"\begin{cases}0\le z\perp(M+M^{\top})z+q-M^{\top}\mu\ge0\\0\le\mu\perp Mz+q\ge0\end{cases}", 16
        ),
        text(
            "A solution of the LCP satisfies them with $\\mu=z$. At $z$ = «z»: the largest wrong sign is «sign», the "
            "largest product «product».",
            z=z, sign=held.sign, product=held.product,
        ),
        *shown(trips("lcp-nonsymmetric", "lcp-qp-nonsymmetric", "lcp-mlcp", "lcp-avi")),
    )  # fmt: skip


def _methods() -> tuple[Block, ...]:
    return (
        Heading("Methods"),
        text(
            "Pivoting walks from one choice to the next; generalized Newton methods solve $\\min(z,w)=0$; splitting "
            "methods sweep row by row; interior points and quadratic programs serve when $M$ is semidefinite."
        ),
        by_solvers("lcp", "lemke", "bpp", "newton-min", "pgs"),
        text("Registered for this formulation: «all».", all=registered("lcp")),
        Try(
            (
                "cpbench solve problems.h5::lcp --solver lemke",
                "cpbench solve problems.h5::mlcp-singular --solver lemke",
                "cpbench convert problems.h5::lcp-nonsymmetric lcp-as-qp.h5 --to qp --via nonsymmetric",
            )
        ),
    )


def _cones(name: str, told: Text) -> Figure:
    problem = problems()[name]
    assert isinstance(problem, LCP)
    alt = f"Complementary cones of the problem {name}, and the path of Lemke's method"
    with canvas.drawing():
        return Figure(svg.inline(lcp_cones.draw(problem), f"fig-cones-{name}", alt), told, alt)
