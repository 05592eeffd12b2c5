"""Nonlinear programs of Hock and Schittkowski's collection, by their numbers there.

Three families by what their rows are, which that collection has in the names of its classes, too: what suits one is
often nothing for another. Starting points are the published ones. These are the ones that differ most. Of hs13 the
minimum has no multipliers, so that it is no point of Karush, Kuhn and Tucker: it is left out.

The book prints z* and f* to some ten digits, without multipliers. POINTS are the Karush–Kuhn–Tucker points of the
active constraints found there by Newton's method in 60 digits (mpmath), rounded once; where the minimum is a round
point, it is that point.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from cpbench.formulations.programs import NLP, NLPPoint
from cpbench.generators.base import Instance, collection
from cpbench_problems.generators.symbols import Symbol, mapped, unknowns


class Known(NamedTuple):
    """f*, z*, multipliers of g ≥ 0, of h = 0 and of the bounds; () where all are 0."""

    objective: float
    z: Sequence[float]
    lam: Sequence[float] = ()
    mu: Sequence[float] = ()
    nu: Sequence[float] = ()


POINTS: Mapping[int, Known] = {
    1: Known(0.0, (1.0, 1.0)),
    3: Known(0.0, (0.0, 0.0), (), (), (0.0, 1.0)),
    5: Known(-1.9132229549810364, (-0.5471975511965977, -1.5471975511965979)),
    6: Known(0.0, (1.0, 1.0)),
    7: Known(-1.7320508075688772, (0.0, 1.7320508075688772), (), (-0.28867513459481287,)),
    21: Known(-99.96, (2.0, 0.0), (), (), (0.04, 0.0)),
    24: Known(-1.0000000000000002, (3.0, 1.7320508075688774), (0.8660254037844388, 0.0, 0.5000000000000001)),
    26: Known(0.0, (1.0, 1.0, 1.0)),
    28: Known(0.0, (0.5, -0.5, 0.5)),
    35: Known(0.1111111111111111, (1.3333333333333333, 0.7777777777777778, 0.4444444444444444), (0.2222222222222222,)),
    39: Known(-1.0, (1.0, 1.0, 0.0, 0.0), (), (1.0, 1.0)),
    43: Known(-44.0, (0.0, 1.0, 2.0, -1.0), (1.0, 0.0, 2.0)),
    49: Known(0.0, (1.0, 1.0, 1.0, 1.0, 1.0)),
    71: Known(
        17.014017289156303,
        (1.0, 4.742999637264417, 3.8211499841848737, 1.3794082931726723),
        (0.5522936601207268,),
        (-0.16146856677050583,),
        (1.087871228666941, 0.0, 0.0, 0.0),
    ),
    76: Known(
        -4.681818181818182,
        (0.2727272727272727, 2.090909090909091, 0.0, 0.5454545454545454),
        (0.45454545454545453, 0.0, 0.0),
        (),
        (0.0, 0.0, 1.7272727272727273, 0.0),
    ),
}


Formula = Callable[..., Sequence[Any]]
INF = float("inf")
ROOT3 = 3.0**0.5


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


# ------------------------------------------------------------------------------------ two unknowns

_program(1, (-2, 1), _rosenbrock, lb=(-INF, -1.5))
_program(3, (10, 1), lambda a, b: b + 1e-5 * (b - a) ** 2, lb=(-INF, 0), convex=True)
_program(
    5,
    (0, 0),
    lambda a, b: (a + b).sin() + (a - b) ** 2 - 1.5 * a + 2.5 * b + 1.0,
    lb=(-1.5, -3),
    ub=(4, 3),
)
_program(6, (-1.2, 1), lambda a, b: (1.0 - a) ** 2, h=lambda a, b: [10.0 * (b - a**2)])
_program(7, (2, 2), lambda a, b: (1.0 + a**2).log() - b, h=lambda a, b: [(1.0 + a**2) ** 2 + b**2 - 4.0])
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
_program(
    28,
    (-4, 1, 1),
    lambda a, b, c: (a + b) ** 2 + (b + c) ** 2,
    h=lambda a, b, c: [a + 2.0 * b + 3.0 * c - 1.0],
    convex=True,
)
_program(
    35,
    (0.5, 0.5, 0.5),
    lambda a, b, c: 9.0 - 8.0 * a - 6.0 * b - 4.0 * c + 2.0 * a**2 + 2.0 * b**2 + c**2 + 2.0 * a * b + 2.0 * a * c,
    lambda a, b, c: [3.0 - a - b - 2.0 * c],
    lb=0,
    convex=True,
)

# ----------------------------------------------------------------------------------- four unknowns

_program(39, (2, 2, 2, 2), lambda a, b, c, d: -a, h=lambda a, b, c, d: [b - a**3 - c**2, a**2 - b - d**2])
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
    49,
    (10, 7, 2, -3, 0.8),
    lambda a, b, c, d, e: (a - b) ** 2 + (c - 1.0) ** 2 + (d - 1.0) ** 4 + (e - 1.0) ** 6,
    h=lambda a, b, c, d, e: [a + b + c + 4.0 * d - 7.0, c + 5.0 * e - 6.0],
    convex=True,
)
