"""Systems of nonlinear equations with known roots, from Moré, Garbow and Hillstrom's collection."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cpbench.formulations.nonlinear import Equation, EquationPoint
from cpbench.generators.base import Instance, collection
from cpbench_problems.generators.ncp_classics import formula_map
from cpbench_problems.generators.symbols import Symbol, total

CITATION = "Moré, Garbow, Hillstrom 1981, ACM Trans. Math. Softw. 7:17"


@collection("equations", "equation", "systems of equations with known roots", CITATION)
def build() -> list[Instance]:
    """Build Rosenbrock's, Freudenstein and Roth's, Powell's singular and Brown's almost linear function."""
    return [
        _known("rosenbrock", lambda x: [10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]], (-1.2, 1), (1, 1), "regular"),
        freudenstein_roth(),
        powell_singular(),
        *(brown(n) for n in (5, 20)),
        *(extended_rosenbrock(n) for n in (30, 60)),
        *(broyden_tridiagonal(n) for n in (50, 100, 200)),
    ]


@collection("equations-large", "equation", "systems of equations with up to 10⁵ unknowns", CITATION, tier="standard")
def build_large() -> list[Instance]:
    return [
        *(extended_rosenbrock(n) for n in (1000, 10_000)),
        *(broyden_tridiagonal(n) for n in (1000, 10_000, 100_000)),
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


def extended_rosenbrock(n: int) -> Instance:
    """Build n/2 copies of Rosenbrock's function (number 21 of the collection): the root is (1, …, 1)."""

    def F(x: list[Symbol]) -> list[Any]:
        return [row for a, b in zip(x[::2], x[1::2], strict=True) for row in (10.0 * (b - a**2), 1.0 - a)]

    start = np.tile([-1.2, 1.0], n // 2).tolist()
    problem = _known(f"extended-rosenbrock-{n}", F, start, np.ones(n).tolist(), "regular")
    return replace(problem, known="closed form")


def broyden_tridiagonal(n: int) -> Instance:
    """Build (3 − 2xᵢ)xᵢ − xᵢ₋₁ − 2xᵢ₊₁ + 1 = 0, x₀ = xₙ₊₁ = 0 (number 30), from (−1, …, −1)."""

    def F(x: list[Symbol]) -> list[Any]:
        rows: list[Any] = []
        for i, own in enumerate(x):
            row = (3.0 - 2.0 * own) * own + 1.0
            row = row - x[i - 1] if i else row
            rows.append(row - 2.0 * x[i + 1] if i + 1 < n else row)
        return rows

    return _open(f"broyden-tridiagonal-{n}", F, np.full(n, -1.0))


def _open(name: str, formula: Callable[[list[Symbol]], Sequence[Any]], start: Any) -> Instance:
    """Build a system whose root is not known in closed form."""
    problem = Equation(F=formula_map(start.size, formula), start=start, name=name)
    return Instance(problem, properties={"class": "regular"}, starts=(EquationPoint(z=start),))
