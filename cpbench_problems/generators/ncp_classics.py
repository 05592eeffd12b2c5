"""Nonlinear complementarity problems that carry a name, with their published solutions and starting points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cpbench.formulations.expressions import Map
from cpbench.formulations.nonlinear import NCP, NCPPoint
from cpbench.generators.base import Instance, collection
from cpbench_problems.generators.symbols import Symbol, mapped, product, unknowns

MCPLIB_STARTS = (
    (0.0, 0, 0, 0), (1.0, 1, 1, 1), (100.0, 100, 100, 100), (1.0, 0, 1, 0), (1.0, 0, 0, 0), (0.0, 1, 1, 0),
    (0.0, 1, 0, 1), (1.25, 0, 0, 0.5),
)  # fmt: skip
"""The eight of MCPLIB's kojshin and josephy (Dirkse and Ferris 1995)."""
REGULAR = (1.0, 0.0, 3.0, 0.0)
"""The solution of Kojima and Shindo's problem with z + F(z) > 0."""
DEGENERATE = (6.0**0.5 / 2.0, 0.0, 0.0, 0.5)
"""The other one, where z₃ = F₃(z) = 0; the only one of Josephy's problem, and regular there."""


@collection(
    "ncp-classics",
    "ncp",
    "NCPs that carry a name",
    "Kojima and Shindo 1986, J. Oper. Res. Soc. Japan 29:352; Josephy 1979, MRC report 1965; Mathiesen 1987, Math. "
    "Prog. 37:1; Billups 1995, thesis, Wisconsin; Munson (MCPLIB); Dirkse and Ferris 1995, OMS 5:319",
)
def build() -> list[Instance]:
    """Build Kojima–Shindo, Josephy, Mathiesen's market at two data, Billups, munson1."""
    return [
        kojima_shindo(),
        josephy(),
        mathiesen("mathiesen", share=0.75, rest=0.25, b=(1.0, 0.5), solution=(0.5, 3.0, 1.0, 2.0)),
        mathiesen("mathiesen-hard", share=0.9, rest=0.1, b=(5.0, 3.0), solution=(3.0, 6.0, 1.0, 5.0)),
        billups(),
        munson1(),
    ]


def formula_map(n: int, formula: Callable[[list[Symbol]], Sequence[Any]]) -> Map:
    """Return the map z ↦ formula(z) of n unknowns."""
    z = unknowns(n)
    return mapped(z, formula(z))


def points(*vectors: Sequence[float]) -> tuple[NCPPoint, ...]:
    return tuple(NCPPoint(z=np.array(v, dtype=float)) for v in vectors)


def kojima_shindo_map(c2: float = 10.0, constant: float = 9.0, d3: float = 9.0) -> Map:
    """Return Kojima's four quadratics, or those with another coefficient of c in the second row and other ones of d and
    1 in the third."""

    def F(z: list[Symbol]) -> list[Symbol]:
        a, b, c, d = z
        return [
            3.0 * a**2 + 2.0 * a * b + 2.0 * b**2 + c + 3.0 * d - 6.0,
            2.0 * a**2 + a + b**2 + c2 * c + 2.0 * d - 2.0,
            3.0 * a**2 + a * b + 2.0 * b**2 + 2.0 * c + d3 * d - constant,
            a**2 + 3.0 * b**2 + 2.0 * c + 3.0 * d - 3.0,
        ]

    return formula_map(4, F)


def kojima_shindo() -> Instance:
    """Build four quadratics, not monotone, with two solutions, one of them degenerate."""
    problem = NCP(F=kojima_shindo_map(), start=MCPLIB_STARTS[0], name="kojima-shindo")
    facts = {
        "class": "two solutions",
        "degenerate": True,
        "solutions": "(1, 0, 3, 0), regular; (√6/2, 0, 0, 1/2), degenerate: z3 = F3(z) = 0",
    }
    return Instance(problem, NCPPoint(z=REGULAR), "published", None, facts, points(*MCPLIB_STARTS))


def josephy() -> Instance:
    """Build Kojima's four quadratics with other second and third rows: F(z) = (0, 2 + √6/2, 5, 0) at the solution."""
    F = kojima_shindo_map(c2=3.0, constant=1.0, d3=3.0)
    problem = NCP(F=F, start=MCPLIB_STARTS[0], name="josephy")
    facts = {"class": "regular", "degenerate": False}
    return Instance(problem, NCPPoint(z=DEGENERATE), "published", None, facts, points(*MCPLIB_STARTS))


def mathiesen(name: str, share: float, rest: float, b: Sequence[float], solution: Sequence[float]) -> Instance:
    """Build activity y and prices p of three goods; the consumer owns b₂, b₃ and spends `share` on good 1, `rest` on
    good 2.

    Homogeneous in p: with p, every t·p with t > 0 is a solution, and F′ is singular there. Not defined at p = 0.
    """

    def F(z: list[Symbol]) -> list[Symbol]:
        y, p1, p2, p3 = z
        income = b[0] * p2 + b[1] * p3
        return [p2 + p3 - p1, y - share * income / p1, b[0] - y - rest * income / p2, b[1] - y]

    problem = NCP(F=formula_map(4, F), start=np.ones(4), name=name)
    facts = {"class": "homogeneous, singular", "ray": f"y = {solution[0]:g}, p = t·{tuple(solution[1:])}, t > 0"}
    return Instance(problem, NCPPoint(z=np.array(solution)), "published", properties=facts, starts=points(np.ones(4)))


def billups() -> Instance:
    """Build F(z) = (z − 1)² − 1.01, from 0: Newton's directions lead to where merits are least, which is no
    solution.
    """
    problem = NCP(F=formula_map(1, lambda z: [(z[0] - 1.0) ** 2 - 1.01]), start=np.zeros(1), name="billups")
    solution = NCPPoint(z=[1.0 + np.sqrt(1.01)])
    facts = {"class": "made against Newton", "degenerate": False}
    return Instance(problem, solution, "published", None, facts, points((0.0,)))


def munson1() -> Instance:
    """Build three unknowns of MCPLIB, affine: z = (1, 0, 0)."""
    M, q = np.array([[1.0, 2, 3], [0, 1, -1], [1, 1, 0]]), (-1.0, 1.0, 1.0)
    F = formula_map(3, lambda z: [row + c for row, c in zip(product(M, z), q, strict=True)])
    return Instance(NCP(F=F, name="munson1"), NCPPoint(z=[1.0, 0, 0]), "published", properties={"class": "affine"})
