"""Membranes and surfaces between obstacles on the unit square: an affine, an exponential and a geometric law.

n×n interior points, h = 1/(n + 1). There is no solution in closed form.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from cpbench.formulations.expressions import Map
from cpbench.formulations.nonlinear import MiCP
from cpbench.foundation.matrices import Dense
from cpbench.generators.base import Instance, collection
from cpbench_problems.generators.symbols import Symbol, mapped, sine, total, unknowns


@collection(
    "membranes",
    "micp",
    "a membrane between two obstacles, Bratu's equation below a roof, a minimal surface over a block",
    "Ciarlet 1978, The Finite Element Method for Elliptic Problems (MCPLIB: obstacle); Hoppe and Mittelmann 1989, IMA "
    "J. Numer. Anal. 9:497 (Bratu); Dolan, Moré, Munson 2004, COPS 3.0, problem 17",
)
def build() -> list[Instance]:
    return [
        *(membrane(n) for n in (10, 20)),
        *(bratu(n, load, 0.5) for n, load in ((7, 12.0), (10, 6.0), (20, 12.0))),
        *(minimal_surface(n) for n in (9, 19)),
    ]


@collection(
    "membranes-large",
    "micp",
    "the same with up to 10⁴ unknowns",
    "Ciarlet 1978 (MCPLIB: obstacle); Hoppe and Mittelmann 1989 (Bratu); Dolan, Moré, Munson 2004 (COPS 3.0)",
    tier="standard",
)
def build_large() -> list[Instance]:
    return [
        membrane(50),
        membrane(100),
        bratu(20, 6.0, 0.5),
        bratu(50, 12.0, 0.5),
        bratu(100, 12.0, 0.5),
        minimal_surface(49),
        minimal_surface(79),
    ]


class _Square:
    """Unknowns u[i][j] at the interior points, with 0 or `edge`, (n + 2, n + 2), around them."""

    def __init__(self, n: int, edge: Dense | None = None) -> None:
        self.n, self.h = n, 1.0 / (n + 1)
        self.unknowns = unknowns(n * n)
        self.edge = np.zeros((n + 2, n + 2)) if edge is None else edge
        self.inside = list(itertools.product(range(1, n + 1), repeat=2))

    def __call__(self, i: int, j: int) -> Any:
        if 1 <= i <= self.n and 1 <= j <= self.n:
            return self.unknowns[(i - 1) * self.n + j - 1]
        return float(self.edge[i, j])

    def laplacian(self, i: int, j: int) -> Symbol:
        """Return −h²Δu, where u is 0 around."""
        around = [self(*at) for at in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1))]
        return 4.0 * self(i, j) - total(u for u in around if isinstance(u, Symbol))

    def map(self, rows: list[Symbol]) -> Map:
        return mapped(self.unknowns, rows)


def membrane(n: int, load: float = 1.0) -> Instance:
    """Build −Δu = load between (sin 9.2x · sin 9.3y)³ and (sin 9.2x · sin 9.3y)² + 0.2; starts at max(0, lb)."""
    u = _Square(n)
    at = np.arange(1, n + 1) * u.h
    wave = np.multiply.outer(sine(9.2 * at), sine(9.3 * at)).ravel()
    lb, ub = wave * wave * wave, wave * wave + 0.2
    F = u.map([u.laplacian(i, j) - load * u.h**2 for i, j in u.inside])
    problem = MiCP(F=F, lb=lb, ub=ub, start=np.maximum(lb, 0.0), name=f"membrane-{n}x{n}")
    facts = {"class": "affine, SPD M-matrix", "symmetric": True, "bounds": "both"}
    return Instance(problem, properties=facts, starts=(problem.point_from_vector(problem.start),))


def bratu(n: int, load: float, roof: float) -> Instance:
    """Build −Δu = load · eᵘ, 0 ≤ u ≤ roof. Without the roof there is no solution for loads above 6.808.

    The symmetric Jacobian −Δ − load · eᵘ loses its definiteness as u grows: not monotone on the whole box.
    """
    u = _Square(n)
    weight = load * u.h**2
    F = u.map([u.laplacian(i, j) - weight * u.unknowns[k].exp() for k, (i, j) in enumerate(u.inside)])
    problem = MiCP(F=F, lb=np.zeros(n * n), ub=np.full(n * n, roof), name=f"bratu-{n}x{n}-{load:g}")
    return Instance(problem, properties={"class": "semilinear", "symmetric": True, "bounds": "both", "load": load})


def minimal_surface(n: int) -> Instance:
    """Build the gradient of the area over u = 1 − (2x − 1)² on two sides, 0 on the others, u ≥ 1 on the middle quarter.

    Two triangles a cell: the one of a point and its right and upper neighbours has the area ½h²·√(1 + |∇u|²).
    """
    axis = np.arange(n + 2) / (n + 1)
    edge = np.zeros((n + 2, n + 2))
    edge[:, 0] = edge[:, -1] = 1.0 - (2.0 * axis - 1.0) ** 2
    u = _Square(n, edge)
    pull: list[Any] = [0.0] * (n * n)
    inside = set(u.inside)

    def add(i: int, j: int, term: Any) -> None:
        if 1 <= i <= n and 1 <= j <= n:
            at = (i - 1) * n + j - 1
            pull[at] = term if isinstance(pull[at], float) else pull[at] + term

    for i, j, s in itertools.product(range(n + 2), range(n + 2), (1, -1)):  # triangles that look forward and back
        corners = ((i, j), (i + s, j), (i, j + s))
        if not all(0 <= c <= n + 1 for corner in corners for c in corner) or not any(c in inside for c in corners):
            continue
        here: Any = u(i, j)
        a, b = u(i + s, j) - here, u(i, j + s) - here
        root = (1.0 + (a * a + b * b) * (1.0 / u.h**2)).sqrt()
        add(i + s, j, a / root)
        add(i, j + s, b / root)
        add(i, j, -(a + b) / root)
    F = u.map([0.5 * term for term in pull])
    middle = (np.abs(axis[1:-1] - 0.5) <= 0.25).astype(float)
    lb = np.multiply.outer(middle, middle).ravel()
    start = np.maximum(np.repeat(1.0 - (2.0 * axis[1:-1] - 1.0) ** 2, n), lb)
    problem = MiCP(F=F, lb=lb, ub=np.full(n * n, np.inf), start=start, name=f"minimal-surface-{n}x{n}")
    facts = {"class": "strictly convex, symmetric", "symmetric": True, "bounds": "lower"}
    return Instance(problem, properties=facts, starts=(problem.point_from_vector(start),))
