"""Small problems with nonlinear maps: a program, complementarity, inequalities over still and moving sets, a ball."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cpbench import CP, NCP, NLP, QVI, VI, Cone, NonlinearFrictionContact, Problem, ProductCone, make
from cpbench.formulations.conic import cone_fields
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.recording import recorded
from cpbench.foundation.matrices import Vector

STEP, DRAG, MASS, GRAVITY = 0.05, 0.4, 1.0, 9.81
"""Time step [s], drag [kg/m], mass [kg] and acceleration [m/s²] of the ball in a heavy fluid."""


def mapped(n: int, formula: Callable[..., Sequence[Any]]) -> Map:
    """The map of n unknowns that a formula of n symbols says.

    >>> mapped(2, lambda a, b: [a * b, a - b])(np.array([2.0, 3.0])).tolist()
    [6.0, -1.0]
    """
    return recorded(n, lambda z: list(formula(*z)))


def converted(problem: Problem, *edges: str) -> Any:
    """The problem after some conversions."""
    for edge in edges:
        problem = make(edge).apply(problem)[0]
    return problem


def four_unknowns(start: Vector) -> NCP:
    """Kojima and Shindo's problem (19)."""

    def formula(a: Any, b: Any, c: Any, d: Any) -> list[Any]:
        return [
            3 * a * a + 2 * a * b + 2 * b * b + c + 3 * d - 6,
            2 * a * a + a + b * b + 10 * c + 2 * d - 2,
            3 * a * a + a * b + 2 * b * b + 2 * c + 9 * d - 9,
            a * a + 3 * b * b + 2 * c + 3 * d - 3,
        ]

    return NCP(F=mapped(4, formula), start=start)


def program_14() -> NLP:
    """Problem 14 of Hock and Schittkowski; the start is inside, so that minima have multipliers (Slater)."""
    return NLP(
        f=mapped(2, lambda x, y: [(x - 2) ** 2 + (y - 1) ** 2]),
        g=mapped(2, lambda x, y: [1 - x * x / 4 - y * y]),
        h=mapped(2, lambda x, y: [x - 2 * y + 1]),
        start=np.array([0.0, 0.5]),
        convex=True,
    )


def disk() -> VI:
    """A hardening spring with a swirl, over the unit disk."""
    K = ProductCone.of((Cone.BALL, 1, 2, 1.0))
    F = mapped(2, lambda x, y: [x - y + x**3 - 1.5, x + y + y**3 - 1.75])
    return VI(F=F, start=np.zeros(2), **cone_fields(K))  # pyright: ignore[reportArgumentType]


def whole_plane() -> VI:
    """The same without the disk: an equation."""
    return VI(F=disk().F, start=np.zeros(2))


def over_cone() -> CP:
    """One second-order cone in three dimensions, a cubic map."""
    K = ProductCone.of((Cone.SECOND_ORDER, 1, 3, 1.0))
    F = mapped(3, lambda n, s, t: [2 * n + s / 2 - 1, n / 2 + s + s**3 + 1.5, 1.5 * t + t**3 - 0.5])
    return CP(F=F, start=np.array([1.0, 0.0, 0.0]), **cone_fields(K))  # pyright: ignore[reportArgumentType]


def duopoly() -> QVI:
    """Harker's two firms: 0 ≤ z ≤ 10, and each chooses within the 15 less what the other takes."""
    F = mapped(2, lambda a, b: [2 * a + 8 * b / 3 - 34, 5 * a / 4 + 2 * b - 24.25])
    return QVI(F=F, upper=mapped(2, lambda a, b: [15 - b, 15 - a]), lb=np.zeros(2), ub=np.full(2, 10.0))


def ball() -> NonlinearFrictionContact:
    """A ball thrown along a floor through a heavy fluid, one step of implicit Euler: drag as the speed squared.

    Velocities (x, y, z), the contact's rows (N, T1, T2) = (z, x, y).
    """
    before = np.array([3.0, 1.0, -2.0])
    load = MASS * before - STEP * MASS * GRAVITY * np.array([0.0, 0.0, 1.0])

    def formula(*v: Any) -> list[Any]:
        drag = STEP * DRAG * np.sqrt(sum(x * x for x in v) + 1e-2)
        return [MASS * x + drag * x - b for x, b in zip(v, load, strict=True)]

    H = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    return NonlinearFrictionContact(F=mapped(3, formula), H=H, w=np.zeros(3), mu=np.array([0.4]), start=before)


def problems(known: dict[str, Problem]) -> dict[str, Problem]:
    """By name; those called linear are problems of `known` in the dress of a nonlinear node."""
    four, program, plant = four_unknowns(np.array([0.9, 0.1, 2.8, 0.1])), program_14(), ball()
    return {
        "kojima-shindo": four,
        "kojima-shindo-equation": converted(four, "ncp-micp", "micp-equation-min"),
        "program": program,
        "program-conditions": converted(program, "nlp-micp"),
        "program-inclusion": converted(program, "nlp-ge"),
        "disk": disk(),
        "plane-equation": whole_plane(),
        "cubic-cone": over_cone(),
        "cubic-cone-inequality": converted(over_cone(), "cp-vi"),
        "duopoly": duopoly(),
        "ball": plant,
        "ball-linearized": converted(plant, "nfc-gfc"),
        "linear-ncp": converted(known["lcp"], "lcp-ncp"),
        "linear-micp": converted(known["mlcp"], "mlcp-micp"),
        "linear-vi": converted(known["avi"], "avi-vi"),
        "linear-ge": converted(known["avi"], "avi-vi", "vi-ge"),
        "linear-cp": converted(known["soclcp"], "soclcp-cp"),
        "linear-nlp": converted(known["qp"], "qp-nlp"),
    }
