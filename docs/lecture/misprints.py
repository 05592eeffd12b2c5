"""Where the page departs from the printed lecture, each with a number that shows why."""

from __future__ import annotations

import numpy as np

from cpbench import FrictionContact
from lecture import cells
from lecture.blocks import Section, table, text
from lecture.numerics import ncp_functions as ncp
from lecture.numerics.examples import problems
from lecture.numerics.examples.nonlinear import program_14
from lecture.numerics.friction import direct_law, outer_law
from lecture.numerics.round_trips import answer, round_trip


def section() -> Section:
    """The list of mended formulas."""
    problem = problems()["sliding"]
    assert isinstance(problem, FrictionContact)
    trip = round_trip(problem, "fc-mlcp-outer")
    outer = outer_law(problem, trip.lifted.arrays()["r"], answer(trip.target).point.v, 8)
    odd = direct_law(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), 0.6, xi=0.0)
    w, z = np.array([-1.0]), np.array([2.0 - 3.0**0.5])
    inside = float(program_14(np.zeros(1), np.zeros(1))[1][0])
    rows = (
        ("(14)", "$Du+bv+b$", "$Du+Bv+b$", "a vector cannot multiply $v$"),
        ("after (14)", "$M=b-DA^{-1}C$", "$M=B-DA^{-1}C$", "as above"),
        (
            "(16)",
            "$-A^{\\top}\\lambda-M^{\\top}\\mu$",
            "$-M^{\\top}\\mu$",
            "the multiplier of $z\\ge0$ is what is left over",
        ),
        ("(17), (20), (23)", "$F(z)$, $F$, $N_Xx$", "$F(x)$, $G$, $N_X(z)$", "one name for one thing"),
        (
            "(30)",
            "$-g$, $-h$",
            "$+g$, $+h$",
            "at $(0,0)$ in problem 14, where $\\lambda=0$ is right, the printed sign leaves «inside»",
        ),
        ("(33)", "$H_k(x_k)$, $\\Phi(x_k)$", "$H_k$, $\\Phi(z_k)$", "the iterate is $z_k$"),
        (
            "(38)",
            "$wz+\\tfrac12\\min{}^2(0,z+w)$",
            "$wz-\\tfrac12\\min{}^2(0,z+w)$",
            "printed, it vanishes at $w$ = «w», $z$ = «z»: «printed»",
        ),
        ("(40)", "$+\\hat f$, $\\hat Gv$", "$-f$, $G^{\\top}v$", "signs of FCLIB, whose files the library reads"),
        ("(42), (47)", "$\\lambda_t$", "$r_{\\mathrm T}$", "the tangential impulse has a name already"),
        (
            "(46)",
            "$-u_t\\in\\sum-\\kappa_ic_i$",
            "$-u_{\\mathrm T}=\\sum\\kappa_ic_i$",
            "what should vanish has length «outer» as printed, «mended» mended",
        ),
        ("(47), (48)", "$d_i=-d_i$", "$d_j=-d_i$", "only $0$ is its own opposite"),
        (
            "(48)",
            "$D^{\\top}v_t$, $0\\le\\lambda\\perp\\lambda\\perp\\ldots$",
            "$D^{\\top}u_{\\mathrm T}$, $0\\le\\lambda\\perp\\mu r_{\\mathrm N}-e^{\\top}\\beta$",
            "one $\\lambda$ too many",
        ),
        (
            "(49)",
            "$\\|r_{\\mathrm T}\\|u_{\\mathrm T}$",
            "also $\\mu r_{\\mathrm N}u_{\\mathrm T}$",
            "where $\\xi$ is an unknown, printed «free», mended «bound»",
        ),
    )
    return Section(
        "misprints",
        "Formulas that were mended",
        text("Slides are written fast. Where the page differs from them, this is why."),
        (
            table(
                ("equation", "printed", "here", "because"),
                rows,
                "What the page changed.",
                inside=inside,
                w=float(w[0]),
                z=float(z[0]),
                printed=cells.error(abs(float(ncp.smooth_as_printed(w, z)[0]))),
                outer=outer.printed,
                mended=cells.error(outer.mismatch),
                free=odd.printed,
                bound=odd.mended,
            ),
        ),
    )
