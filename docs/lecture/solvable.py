"""Inclusions and nonsmooth equations as problems of the library, solved: beside (27)-(38)."""

from __future__ import annotations

import numpy as np

from lecture import cells
from lecture.blocks import Block, Heading, Try, table, text
from lecture.conversions import by_solvers, shown, trips
from lecture.numerics import ncp_functions as ncp
from lecture.numerics.examples.maps import converted, four_unknowns
from lecture.numerics.round_trips import outcome

EDGES = {
    "(35)": "micp-equation-min",
    "(36)": "micp-equation-fb",
    "(37)": "micp-equation-pfb",
    "(38)": "micp-equation-ep",
}
STARTS = (np.array([0.9, 0.1, 2.8, 0.1]), np.array([1.2, 0.1, 0.1, 0.4]))
"""Near the regular solution and near the degenerate one."""


def inclusions() -> tuple[Block, ...]:
    """The edges of `ge`, and those from complementarity to inequalities."""
    return (
        text(
            "As problems of the library: the conditions of problem 14 as (30), with the mended signs, and the triangle "
            "of the section before with its walls priced. An inclusion over a box is a mixed problem, one over any "
            "other set an inequality."
        ),
        *shown(
            [
                *trips("program-inclusion", "ge-micp", "ge-vi"),
                *trips("linear-ge", "ge-avi"),
                *trips("program-conditions", "micp-vi"),
                *trips("linear-micp", "micp-avi"),
            ]
        ),
    )


def equations() -> tuple[Block, ...]:
    """Each function makes an equation that any root finder may be tried on."""
    rows = []
    for function in ncp.functions():
        found = []
        for start in STARTS:
            problem = converted(four_unknowns(start), "ncp-micp", EDGES[function.equation])
            z = outcome(problem, "newton-equation")
            found += ["stops", "—"] if z is None else [cells.vector(z), cells.error(problem.F(z) @ problem.F(z))]
        rows.append((cells.words(f"{function.equation} {function.name}"), *found))
    return (
        Heading("Equations that are problems"),
        text(
            "The library takes each function, and the normal map (26), as a conversion: to a system of equations with "
            "corners, written out operation by operation, that any root finder may be tried on. Problem 14:"
        ),
        *shown(
            trips(
                "program-conditions",
                "micp-equation-min",
                "micp-equation-fb",
                "micp-equation-pfb",
                "micp-equation-ep",
                "micp-equation-normal",
            )
        ),
        table(
            ("function", "from near $(1,0,3,0)$", "$\\|\\Phi\\|^2$", "from near $(\\tfrac12\\sqrt6,0,0,\\tfrac12)$",
             "$\\|\\Phi\\|^2$"),
            rows,
            "Both solutions of the problem with four unknowns, as zeros of the four equations found by "
            "`newton-equation`. Where $H$ is singular a small $\\Phi$ says less about $z$.",
        ),
        by_solvers(
            "kojima-shindo-equation", "newton-equation", "scipy-root-hybr", "scipy-root-lm", "scipy-root-krylov",
            "scipy-root-df-sane",
        ),
        Try(
            (
                "cpbench solve problems.h5::kojima-shindo-equation --solver newton-equation",
                "cpbench solve problems.h5::program-inclusion --solver newton-fb-micp",
                "cpbench convert problems.h5::kojima-shindo four.h5 --to equation --via micp-equation-pfb",
            )
        ),
    )  # fmt: skip
