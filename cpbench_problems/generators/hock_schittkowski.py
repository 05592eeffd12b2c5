"""Nonlinear programs of Hock and Schittkowski's collection, by their numbers there.

Three families by what their rows are, which that collection has in the names of its classes, too: what suits one is
often nothing for another. Starting points are the published ones. Of hs13 the minimum has no multipliers, so that it
is no point of Karush, Kuhn and Tucker: it is left out. Known points have all their digits, in
`hock_schittkowski_points`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpbench.formulations.programs import NLP, NLPPoint
from cpbench.generators.base import Instance, collection
from cpbench_problems.generators.hock_schittkowski_points import POINTS, Known
from cpbench_problems.generators.symbols import Symbol, exp, log, mapped, sin, total, unknowns

Formula = Callable[..., Sequence[Any]]
INF = float("inf")
ROOT3, ROOT2 = 3.0**0.5, 2.0**0.5


CITATION = "Hock and Schittkowski 1981, Test Examples for Nonlinear Programming Codes, Springer, LNEMS 187"


@collection("hock-schittkowski-bounds", "nlp", "programs of Hock and Schittkowski with bounds only", CITATION)
def bounded() -> list[Instance]:
    return _instances("bounds")


@collection("hock-schittkowski-linear", "nlp", "programs of Hock and Schittkowski with linear rows", CITATION)
def linear() -> list[Instance]:
    return _instances("linear")


@collection("hock-schittkowski-nonlinear", "nlp", "programs of Hock and Schittkowski with nonlinear rows", CITATION)
def nonlinear() -> list[Instance]:
    return _instances("nonlinear")


@dataclass(frozen=True)
class _Program:
    """min f(*x), g(*x) ≥ 0, h(*x) = 0, lb ≤ x ≤ ub; one number is the bound of every component."""

    start: Sequence[float]
    f: Callable[..., Any]
    g: Formula | None = None
    h: Formula | None = None
    lb: Sequence[float] | float = -INF
    ub: Sequence[float] | float = INF
    convex: bool = False

    def problem(self, name: str) -> NLP:
        n = len(self.start)

        def maps(formula: Formula | None) -> Any:
            x = unknowns(n)
            return mapped(x, formula(*x)) if formula else None

        return NLP(
            f=maps(lambda *x: [self.f(*x)]), g=maps(self.g), h=maps(self.h), lb=np.broadcast_to(self.lb, n),
            ub=np.broadcast_to(self.ub, n), start=np.array(self.start, dtype=float), convex=self.convex, name=name,
        )  # fmt: skip


_PROGRAMS: dict[int, _Program] = {}


def _program(number: int, *parts: Any, **others: Any) -> None:
    _PROGRAMS[number] = _Program(*parts, **others)


def _instances(rows: str) -> list[Instance]:
    """Build the instances whose rows are only bounds, linear, or nonlinear."""
    problems = {number: program.problem(f"hs{number}") for number, program in sorted(_PROGRAMS.items())}
    return [_instance(problem, POINTS[number]) for number, problem in problems.items() if _rows(problem) == rows]


def _rows(problem: NLP) -> str:
    if problem.g.rows + problem.h.rows == 0:
        return "bounds"
    return "linear" if problem.g.compiled.affine and problem.h.compiled.affine else "nonlinear"


def _instance(problem: NLP, known: Known) -> Instance:
    n = problem.start.size
    point = NLPPoint(
        z=np.array(known.z), lam=_filled(known.lam, problem.g.rows), mu=_filled(known.mu, problem.h.rows),
        nu=_filled(known.nu, n),
    )  # fmt: skip
    begin = NLPPoint(z=problem.start, lam=np.zeros(problem.g.rows), mu=np.zeros(problem.h.rows), nu=np.zeros(n))
    facts = {"class": "convex" if problem.convex else "not known to be convex", "objective": known.objective}
    return Instance(problem, point, "published", properties=facts, starts=(begin,))


def _filled(values: Sequence[float], size: int) -> Any:
    """Fill in multipliers of 0 where none is given."""
    return np.array(values, dtype=float) if values else np.zeros(size)


def _rosenbrock(a: Symbol, b: Symbol) -> Symbol:
    return 100.0 * (b - a**2) ** 2 + (1.0 - a) ** 2


def _product(*x: Symbol) -> Symbol:
    return x[0] * x[1] * x[2] * x[3] * x[4]


# ------------------------------------------------------------------------------------ two unknowns

_program(1, (-2, 1), _rosenbrock, lb=(-INF, -1.5))
_program(2, (-2, 1), _rosenbrock, lb=(-INF, 1.5))
_program(3, (10, 1), lambda a, b: b + 1e-5 * (b - a) ** 2, lb=(-INF, 0), convex=True)
_program(4, (1.125, 0.125), lambda a, b: (a + 1.0) ** 3 / 3.0 + b, lb=(1, 0))
_program(
    5,
    (0, 0),
    lambda a, b: sin(a + b) + (a - b) ** 2 - 1.5 * a + 2.5 * b + 1.0,
    lb=(-1.5, -3),
    ub=(4, 3),
)
_program(6, (-1.2, 1), lambda a, b: (1.0 - a) ** 2, h=lambda a, b: [10.0 * (b - a**2)])
_program(7, (2, 2), lambda a, b: log(1.0 + a**2) - b, h=lambda a, b: [(1.0 + a**2) ** 2 + b**2 - 4.0])
_program(10, (-10, 10), lambda a, b: a - b, lambda a, b: [2.0 * a * b - 3.0 * a**2 - b**2 + 1.0], convex=True)
_program(11, (4.9, 0.1), lambda a, b: (a - 5.0) ** 2 + b**2 - 25.0, lambda a, b: [b - a**2], convex=True)
_program(
    12,
    (0, 0),
    lambda a, b: 0.5 * a**2 + b**2 - a * b - 7.0 * a - 7.0 * b,
    lambda a, b: [25.0 - 4.0 * a**2 - b**2],
    convex=True,
)
_program(
    14,
    (2, 2),
    lambda a, b: (a - 2.0) ** 2 + (b - 1.0) ** 2,
    lambda a, b: [1.0 - 0.25 * a**2 - b**2],
    lambda a, b: [a - 2.0 * b + 1.0],
    convex=True,
)
_program(15, (-2, 1), _rosenbrock, lambda a, b: [a * b - 1.0, a + b**2], ub=(0.5, INF))
_program(
    21,
    (-1, -1),
    lambda a, b: 0.01 * a**2 + b**2 - 100.0,
    lambda a, b: [10.0 * a - b - 10.0],
    lb=(2, -50),
    ub=(50, 50),
    convex=True,
)
_program(
    22,
    (2, 2),
    lambda a, b: (a - 2.0) ** 2 + (b - 1.0) ** 2,
    lambda a, b: [2.0 - a - b, b - a**2],
    convex=True,
)
_program(
    23,
    (3, 1),
    lambda a, b: a**2 + b**2,
    lambda a, b: [a + b - 1.0, a**2 + b**2 - 1.0, 9.0 * a**2 + b**2 - 9.0, a**2 - b, b**2 - a],
    lb=-50,
    ub=50,
)
_program(
    24,
    (1, 0.5),
    lambda a, b: ((a - 3.0) ** 2 - 9.0) * b**3 / (27.0 * ROOT3),
    lambda a, b: [a / ROOT3 - b, a + ROOT3 * b, 6.0 - a - ROOT3 * b],
    lb=0,
)

# ---------------------------------------------------------------------------------- three unknowns

_program(
    26, (-2.6, 2, 2), lambda a, b, c: (a - b) ** 2 + (b - c) ** 4, h=lambda a, b, c: [(1.0 + b**2) * a + c**4 - 3.0]
)
_program(27, (2, 2, 2), lambda a, b, c: 0.01 * (a - 1.0) ** 2 + (b - a**2) ** 2, h=lambda a, b, c: [a + c**2 + 1.0])
_program(
    28,
    (-4, 1, 1),
    lambda a, b, c: (a + b) ** 2 + (b + c) ** 2,
    h=lambda a, b, c: [a + 2.0 * b + 3.0 * c - 1.0],
    convex=True,
)
_program(29, (1, 1, 1), lambda a, b, c: -(a * b * c), lambda a, b, c: [48.0 - a**2 - 2.0 * b**2 - 4.0 * c**2])
_program(
    35,
    (0.5, 0.5, 0.5),
    lambda a, b, c: 9.0 - 8.0 * a - 6.0 * b - 4.0 * c + 2.0 * a**2 + 2.0 * b**2 + c**2 + 2.0 * a * b + 2.0 * a * c,
    lambda a, b, c: [3.0 - a - b - 2.0 * c],
    lb=0,
    convex=True,
)
_program(
    65,
    (-5, 5, 0),
    lambda a, b, c: (a - b) ** 2 + (a + b - 10.0) ** 2 / 9.0 + (c - 5.0) ** 2,
    lambda a, b, c: [48.0 - a**2 - b**2 - c**2],
    lb=(-4.5, -4.5, -5),
    ub=(4.5, 4.5, 5),
    convex=True,
)

# ----------------------------------------------------------------------------------- four unknowns

_program(
    38,
    (-3, -1, -3, -1),
    lambda a, b, c, d: (
        _rosenbrock(a, b) + 90.0 * (d - c**2) ** 2 + (1.0 - c) ** 2
        + 10.1 * ((b - 1.0) ** 2 + (d - 1.0) ** 2) + 19.8 * (b - 1.0) * (d - 1.0)
    ),
    lb=-10,
    ub=10,
)  # fmt: skip
_program(39, (2, 2, 2, 2), lambda a, b, c, d: -a, h=lambda a, b, c, d: [b - a**3 - c**2, a**2 - b - d**2])
_program(
    40,
    (0.8, 0.8, 0.8, 0.8),
    lambda a, b, c, d: -(a * b * c * d),
    h=lambda a, b, c, d: [a**3 + b**2 - 1.0, a**2 * d - c, d**2 - b],
)
_program(
    41,
    (2, 2, 2, 2),
    lambda a, b, c, d: 2.0 - a * b * c,
    h=lambda a, b, c, d: [a + 2.0 * b + 2.0 * c - d],
    lb=0,
    ub=(1, 1, 1, 2),
)
_program(
    42,
    (1, 1, 1, 1),
    lambda *x: total((s - k) ** 2 for k, s in enumerate(x, 1)),
    h=lambda a, b, c, d: [a - 2.0, c**2 + d**2 - 2.0],
)
_program(
    43,
    (0, 0, 0, 0),
    lambda a, b, c, d: a**2 + b**2 + 2.0 * c**2 + d**2 - 5.0 * a - 5.0 * b - 21.0 * c + 7.0 * d,
    lambda a, b, c, d: [
        8.0 - a**2 - b**2 - c**2 - d**2 - a + b - c + d,
        10.0 - a**2 - 2.0 * b**2 - c**2 - 2.0 * d**2 + a + d,
        5.0 - 2.0 * a**2 - b**2 - c**2 - 2.0 * a + b + d,
    ],
    convex=True,
)
_program(
    71,
    (1, 5, 5, 1),
    lambda a, b, c, d: a * d * (a + b + c) + c,
    lambda a, b, c, d: [a * b * c * d - 25.0],
    lambda a, b, c, d: [a**2 + b**2 + c**2 + d**2 - 40.0],
    lb=1,
    ub=5,
)
_program(
    76,
    (0.5, 0.5, 0.5, 0.5),
    lambda a, b, c, d: a**2 + 0.5 * b**2 + c**2 + 0.5 * d**2 - a * c + c * d - a - 3.0 * b + c - d,
    lambda a, b, c, d: [
        5.0 - a - 2.0 * b - c - d,
        4.0 - 3.0 * a - b - 2.0 * c + d,
        b + 4.0 * c - 1.5,
    ],
    lb=0,
    convex=True,
)

# ----------------------------------------------------------------------------------- five unknowns

_program(
    48,
    (3, 5, -3, 2, -2),
    lambda a, b, c, d, e: (a - 1.0) ** 2 + (b - c) ** 2 + (d - e) ** 2,
    h=lambda a, b, c, d, e: [a + b + c + d + e - 5.0, c - 2.0 * (d + e) + 3.0],
    convex=True,
)
_program(
    49,
    (10, 7, 2, -3, 0.8),
    lambda a, b, c, d, e: (a - b) ** 2 + (c - 1.0) ** 2 + (d - 1.0) ** 4 + (e - 1.0) ** 6,
    h=lambda a, b, c, d, e: [a + b + c + 4.0 * d - 7.0, c + 5.0 * e - 6.0],
    convex=True,
)
_program(
    50,
    (35, -31, 11, 5, -5),
    lambda a, b, c, d, e: (a - b) ** 2 + (b - c) ** 2 + (c - d) ** 4 + (d - e) ** 2,
    h=lambda a, b, c, d, e: [a + 2.0 * b + 3.0 * c - 6.0, b + 2.0 * c + 3.0 * d - 6.0, c + 2.0 * d + 3.0 * e - 6.0],
    convex=True,
)
_program(
    51,
    (2.5, 0.5, 2, -1, 0.5),
    lambda a, b, c, d, e: (a - b) ** 2 + (b + c - 2.0) ** 2 + (d - 1.0) ** 2 + (e - 1.0) ** 2,
    h=lambda a, b, c, d, e: [a + 3.0 * b - 4.0, c + d - 2.0 * e, b - e],
    convex=True,
)
_program(
    52,
    (2, 2, 2, 2, 2),
    lambda a, b, c, d, e: (4.0 * a - b) ** 2 + (b + c - 2.0) ** 2 + (d - 1.0) ** 2 + (e - 1.0) ** 2,
    h=lambda a, b, c, d, e: [a + 3.0 * b, c + d - 2.0 * e, b - e],
    convex=True,
)


def _on_sphere(a: Symbol, b: Symbol, c: Symbol, d: Symbol, e: Symbol) -> list[Symbol]:
    return [a**2 + b**2 + c**2 + d**2 + e**2 - 10.0, b * c - 5.0 * d * e, a**3 + b**3 + 1.0]


_BOX = (2.3, 2.3, 3.2, 3.2, 3.2)
_program(78, (-2, 1.5, 2, -1, -1), _product, h=_on_sphere)
_program(
    79,
    (2, 2, 2, 2, 2),
    lambda a, b, c, d, e: (a - 1.0) ** 2 + (a - b) ** 2 + (b - c) ** 2 + (c - d) ** 4 + (d - e) ** 4,
    h=lambda a, b, c, d, e: [
        a + b**2 + c**3 - 2.0 - 3.0 * ROOT2,
        b - c**2 + d + 2.0 - 2.0 * ROOT2,
        a * e - 2.0,
    ],
)
_program(80, (-2, 2, 2, -1, -1), lambda *x: exp(_product(*x)), h=_on_sphere, lb=[-b for b in _BOX], ub=_BOX)
_program(
    81,
    (-2, 2, 2, -1, -1),
    lambda *x: exp(_product(*x)) - 0.5 * (x[0] ** 3 + x[1] ** 3 + 1.0) ** 2,
    h=_on_sphere,
    lb=[-b for b in _BOX],
    ub=_BOX,
)

# ----------------------------------------------------------------------------------- seven and ten

_program(
    100,
    (1, 2, 0, 4, 0, 1, 1),
    lambda a, b, c, d, e, p, q: (
        (a - 10.0) ** 2 + 5.0 * (b - 12.0) ** 2 + c**4 + 3.0 * (d - 11.0) ** 2 + 10.0 * e**6 + 7.0 * p**2 + q**4
        - 4.0 * p * q - 10.0 * p - 8.0 * q
    ),
    lambda a, b, c, d, e, p, q: [
        127.0 - 2.0 * a**2 - 3.0 * b**4 - c - 4.0 * d**2 - 5.0 * e,
        282.0 - 7.0 * a - 3.0 * b - 10.0 * c**2 - d + e,
        196.0 - 23.0 * a - b**2 - 6.0 * p**2 + 8.0 * q,
        3.0 * a * b - 4.0 * a**2 - b**2 - 2.0 * c**2 - 5.0 * p + 11.0 * q,
    ],
)  # fmt: skip
_program(
    113,
    (2, 3, 5, 5, 1, 2, 7, 3, 6, 10),
    lambda a, b, c, d, e, p, q, r, s, t: (
        a**2 + b**2 + a * b - 14.0 * a - 16.0 * b + (c - 10.0) ** 2 + 4.0 * (d - 5.0) ** 2 + (e - 3.0) ** 2
        + 2.0 * (p - 1.0) ** 2 + 5.0 * q**2 + 7.0 * (r - 11.0) ** 2 + 2.0 * (s - 10.0) ** 2 + (t - 7.0) ** 2 + 45.0
    ),
    lambda a, b, c, d, e, p, q, r, s, t: [
        105.0 - 4.0 * a - 5.0 * b + 3.0 * q - 9.0 * r,
        8.0 * b - 10.0 * a + 17.0 * q - 2.0 * r,
        8.0 * a - 2.0 * b - 5.0 * s + 2.0 * t + 12.0,
        120.0 - 3.0 * (a - 2.0) ** 2 - 4.0 * (b - 3.0) ** 2 - 2.0 * c**2 + 7.0 * d,
        40.0 - 5.0 * a**2 - 8.0 * b - (c - 6.0) ** 2 + 2.0 * d,
        30.0 - 0.5 * (a - 8.0) ** 2 - 2.0 * (b - 4.0) ** 2 - 3.0 * e**2 + p,
        2.0 * a * b - a**2 - 2.0 * (b - 2.0) ** 2 - 14.0 * e + 6.0 * p,
        3.0 * a - 6.0 * b - 12.0 * (s - 8.0) ** 2 + 7.0 * t,
    ],
    convex=True,
)  # fmt: skip
