"""Systems of nonlinear equations with known roots, from Moré, Garbow and Hillstrom's collection."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cpbench.formulations.equation import Equation, EquationPoint
from cpbench.generators.base import Instance, collection
from cpbench.generators.ncp_classics import formula_map
from cpbench.generators.symbols import Symbol, total


@collection(
    "equations",
    "equation",
    "systems of equations with known roots",
    "Moré, Garbow, Hillstrom 1981, ACM Trans. Math. Softw. 7:17",
)
def build() -> list[Instance]:
    """Build Rosenbrock's, Freudenstein and Roth's, Powell's singular and Brown's almost linear function."""
    return [
        _known("rosenbrock", lambda x: [10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]], (-1.2, 1), (1, 1), "regular"),
        freudenstein_roth(),
        powell_singular(),
        *(brown(n) for n in (5, 20)),
    ]


def _known(
    name: str,
    formula: Callable[[list[Symbol]], Sequence[Any]],
    start: Sequence[float],
    root: Sequence[float],
    kind: str,
) -> Instance:
    begin = np.array(start, dtype=float)
    problem = Equation(F=formula_map(begin.size, formula), start=begin, name=name)
    solution = EquationPoint(z=np.array(root, dtype=float))
    return Instance(problem, solution, "published", None, {"class": kind}, (EquationPoint(z=begin),))


def freudenstein_roth() -> Instance:
    """Build the system of root (5, 4); Newton's method with descent ends at a minimum of ‖F‖ near (11.4, −0.9), no
    root.
    """

    def F(x: list[Symbol]) -> list[Symbol]:
        a, b = x
        return [a - 13.0 + ((5.0 - b) * b - 2.0) * b, a - 29.0 + ((b + 1.0) * b - 14.0) * b]

    return _known("freudenstein-roth", F, (0.5, -2), (5, 4), "local minimum of the norm")


def powell_singular() -> Instance:
    """Build the system of root 0, where the Jacobian has rank 2: Newton's method converges linearly."""

    def F(x: list[Symbol]) -> list[Symbol]:
        a, b, c, d = x
        return [a + 10.0 * b, 5.0**0.5 * (c - d), (b - 2.0 * c) ** 2, 10.0**0.5 * (a - d) ** 2]

    return _known("powell-singular", F, (3, -1, 0, 1), (0, 0, 0, 0), "singular root")


def brown(n: int) -> Instance:
    """Build n − 1 equations xᵢ + Σx = n + 1 and Πx = 1; one root is (1, …, 1)."""

    def F(x: list[Symbol]) -> list[Symbol]:
        everything = total(x)
        last = x[0]
        for factor in x[1:]:
            last = last * factor
        return [*(s + everything - (n + 1.0) for s in x[:-1]), last - 1.0]

    return _known(f"brown-almost-linear-{n}", F, np.full(n, 0.5).tolist(), np.ones(n).tolist(), "several roots")
