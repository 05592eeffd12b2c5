"""Contact: the time-discretized problems and their frictionless case (40)."""

from __future__ import annotations

from cpbench import GlobalFrictionContact, NonlinearFrictionContact
from cpbench.foundation.matrices import dense, max_abs, norm
from cpbench.report import canvas
from cpbench_lab.pictures import contact as picture
from lecture import cells, svg
from lecture.blocks import Block, Figure, Heading, Section, Try, aside, formula, table, text
from lecture.conversions import data, shown, trips
from lecture.formulas import maps
from lecture.numerics.examples import problems
from lecture.numerics.examples.contact import STEP
from lecture.numerics.examples.maps import MASS
from lecture.numerics.friction import newton_steps
from lecture.numerics.round_trips import answer, refusal, round_trip


def section() -> Section:
    """The problems P, P_LM, P_L, the frictionless case (40), and P."""
    return Section(
        "contact",
        "Contact, one time step",
        text("A moving body touches another: what was abstract so far has a normal, a velocity and an impulse."),
        (*_forms(), *_reduce(), *_frictionless(), *_drag()),
    )


def _forms() -> tuple[Block, ...]:
    problem = problems()["dumbbell"]
    assert isinstance(problem, GlobalFrictionContact)
    found = answer(problem)
    u = problem.slacks(found.point)["u"]
    return (
        text(
            "An implicit time step leaves a problem for the velocities $v$ at its end and the impulses during it. In "
            "general the dynamics are nonlinear,"
        ),
        formula(
            r"\begin{cases}F(v_{k+1})=H\,r_{k+1}\\u_{k+1}=H^{\top}v_{k+1}"
            r"\\\text{contact law}\,[u_{k+1},r_{k+1}]\end{cases}",
            label=r"($\mathcal{P}$)",
        ),
        text("linearised they read, with the impulses $\\lambda$ of joints,"),
        formula(
            r"\begin{cases}Mv_{k+1}=H\,r_{k+1}+G\lambda_{k+1}+f\\G^{\top}v_{k+1}+b=0\\u_{k+1}=H^{\top}v_{k+1}+w\\"
            r"\text{contact law}\,[u_{k+1},r_{k+1}]\end{cases}",
            label=r"($\mathcal{P}_{\mathrm{LM}}$)",
        ),
        text("and with the velocities eliminated only contacts are left:"),
        formula(
            r"\begin{cases}u_{k+1}=W\,r_{k+1}+q\\\text{contact law}\,[u_{k+1},r_{k+1}]\end{cases}",
            label=r"($\mathcal{P}_{\mathrm{L}}$)",
        ),
        text(
            "Signs are those of FCLIB, where $Hr$, $G\\lambda$ and $f$ stand on the same side. In $f$ is the momentum "
            "before the step and the impulse of the known forces during it, $h$ = «h» s long, damping and stiffness "
            "included.",
            h=STEP,
        ),
        Heading("A dumbbell"),
        text(
            "Two balls on a floor, of «m1» kg and «m2» kg, joined by a rigid rod along $x$. Both move along the rod; "
            "the light one is also pushed across. The friction coefficients are «mu».",
            m1=float(dense(problem.M)[0, 0]), m2=float(dense(problem.M)[3, 3]), mu=problem.mu,
        ),
        text(
            "After the step the balls move with $v$ = «v» m/s. The impulses of the floor are $r$ = «r» N s, that of "
            "the rod $\\lambda$ = «lam» N s.",
            v=found.point.v, r=found.point.r, lam=found.point.lam,
        ),
        _states(problem, found.point),
        text(
            "The rod keeps its length: the joint's equation holds to «joint». Neither ball sinks in or lifts off: the "
            "largest normal velocity is «normal» m/s.",
            joint=norm(problem.G.T @ found.point.v + problem.b), normal=max_abs(u[::3]),
        ),
    )  # fmt: skip


def _reduce() -> tuple[Block, ...]:
    local = round_trip(problems()["dumbbell"], "gfc-fc").target
    return (
        Heading("To the contacts alone"),
        text(
            "*Delassus' operator* $W=H^{\\top}M^{-1}H$ says how an impulse at one contact moves all of them. Joints "
            "are kept as unknowns, or eliminated with the velocities. Nothing is inverted; a factorization travels "
            "with the converted problem and gives $v$ and $\\lambda$ back."
        ),
        data(local, "W"),
        text("The rod shows: an impulse along $x$ at one ball moves the other one too, an impulse along $y$ does not."),
        *shown([*trips("dumbbell", "gfc-fc", "gfc-fcm"), *_second_half()]),
    )


def _second_half() -> list:
    """`fcm-fc` on what `gfc-fcm` makes of the dumbbell."""
    mixed = round_trip(problems()["dumbbell"], "gfc-fcm").target
    return [round_trip(mixed, "fcm-fc")]


def _frictionless() -> tuple[Block, ...]:
    known = problems()
    return (
        Heading("Without friction"),
        text("Then the law is Signorini's alone, and the whole step is a mixed linear complementarity problem:"),
        formula(
            r"\begin{cases}Mv_{k+1}-H\,r_{k+1}-G\lambda_{k+1}-f=0\\G^{\top}v_{k+1}+b=0\\u_{k+1}=H^{\top}v_{k+1}+w\\"
            r"0\le u_{\mathrm{N}}\perp r_{\mathrm{N}}\ge0\end{cases}",
            40,
        ),
        text("The dumbbell on ice, and two contacts in the plane that are local already:"),
        *shown([*trips("frictionless", "gfc-mlcp"), *trips("frictionless-local", "fc-lcp-frictionless")]),
        aside(
            "Not for friction",
            text("With friction `gfc-mlcp` refuses: «why».", why=refusal(known["dumbbell"], "gfc-mlcp")),
        ),
        Try(
            (
                "cpbench solve problems.h5::dumbbell --solver nsgs",
                "cpbench convert problems.h5::dumbbell dumbbell-local.h5 --to fc",
                "cpbench info dumbbell-local.h5 --data",
                "cpbench solve problems.h5::frictionless --solver lemke",
            )
        ),
    )


def _drag() -> tuple[Block, ...]:
    """P itself, by Newton's method on the dynamics."""
    problem = problems()["ball"]
    assert isinstance(problem, NonlinearFrictionContact)
    path, found = newton_steps(problem), answer(problem)
    rows = [
        (str(k), cells.vector(step.frozen), cells.vector(step.r), cells.error(step.error))
        for k, step in enumerate(path, start=1)
    ]
    return (
        Heading("Nonlinear dynamics"),
        text(
            "A ball of «mass» kg is thrown along a floor through a heavy fluid, whose drag grows with the square of "
            "its speed. One step of implicit Euler is a problem ($\\mathcal{P}$) with",
            mass=MASS,
        ),
        maps(problem, "F", unknowns=("v_{x}", "v_{y}", "v_{z}"), of="v"),
        text(
            "It ends with $v$ = «v» m/s and the impulse $r$ = «r» N s, normal first. One linearisation is a problem "
            "($\\mathcal{P}_{\\mathrm{LM}}$), and every linear one is a case of ($\\mathcal{P}$):",
            v=found.point.v, r=found.point.r,
        ),
        *shown([*trips("ball", "nfc-gfc"), *trips("ball-linearized", "gfc-nfc")]),
        text("Linearise again at the velocity that came out, and solve the contact again:"),
        table(
            ("step", "linearised at $v$ [m/s]", "impulse $r$ [N s]", "error on ($\\mathcal{P}$)"),
            rows,
            "Newton's method on the dynamics; the law of contact is solved as it is in every step.",
        ),
        Try(("cpbench solve problems.h5::ball --solver newton-nfc",)),
    )  # fmt: skip


def _states(problem: GlobalFrictionContact, point: object) -> Figure:
    """The picture of `cpbench plot contact`."""
    alt = "The disk of friction with a mark for each contact"
    with canvas.drawing():
        drawn = picture.draw(problem, point)  # pyright: ignore[reportArgumentType]
        return Figure(
            svg.inline(drawn.figure, "fig-states", alt),
            text("Tangential impulse over $\\mu r_{\\mathrm N}$: both balls slide, so both marks are on the rim."),
            alt,
        )
