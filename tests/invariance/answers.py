"""Problems of every node around a chosen solution, in units where everything is about 1, with answers right and wrong.

A right answer has a relative error of ε/100 in every unknown: it is exact for data changed by about as much. A wrong
one misses a pair by 200 ε of the largest row, in whatever unit that pair is measured: in many rows, where a part of it
was changed, or in one row alone.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import planted
import planted_conic
import planted_contact
import planted_nonlinear as nonlinear
from inclusions import pairs_of
from pairs import groups

from cpbench.formulations.expressions import Map
from cpbench.foundation.cones import Cone, ProductCone

TOLERANCES = (1e-4, 1e-6, 1e-8)
RNG = np.random.Generator
Made = tuple[Any, Any]


@dataclass(frozen=True, eq=False)
class Answer:
    """An answer to a problem that is right or wrong at a tolerance; `via` is the edge that it has come by."""

    problem: Any
    point: Any
    tolerance: float
    right: bool
    via: str = ""

    def of(self, problem: Any, point: Any) -> Answer:
        """The same answer to the same problem, written in another way."""
        return Answer(problem, point, self.tolerance, self.right)


def _mild(rng: RNG) -> str:
    return str(rng.choice(["positive definite", "monotone"]))


def _small(rng: RNG) -> ProductCone:
    return ProductCone.of(
        (Cone.SECOND_ORDER, 1, 3, rng.uniform(0.3, 1.0, 1)),
        (Cone.NONNEGATIVE, 1, 2),
        (Cone.ROLLING, 1, 3, rng.uniform(0.3, 1.0, 1), rng.uniform(0.3, 1.0, 1)),
        (Cone.FREE, 1, 1),
        (Cone.ZERO, 1, 1),
    )


VARIANTS: dict[str, Callable[[RNG], Made]] = {
    "lcp": lambda g: planted.lcp(g, 5, _mild(g), sparse=bool(g.integers(2))),
    "mlcp": lambda g: planted.mlcp(g, 3, 3, _mild(g), sparse=bool(g.integers(2))),
    "relay": lambda g: planted_conic.relay(g, 5, _mild(g)),
    "avi": lambda g: planted_conic.avi(g, 5, 3, 1, _mild(g)),
    "qp": lambda g: planted.qp(g, 5, 3, 1, sparse=bool(g.integers(2))),
    "coneqp": lambda g: planted_conic.coneqp(g, 6, _small(g)),
    "soclcp": lambda g: planted_conic.soclcp(g, _small(g), _mild(g)),
    "fc-2d": lambda g: planted.fc(g, 3, 2, _mild(g)),
    "fc-3d": lambda g: planted.fc(g, 3, 3, _mild(g), sparse=bool(g.integers(2))),
    "gfc-2d": lambda g: planted_contact.gfc(g, 2, 2, 0, 2),
    "gfc-3d-joints": lambda g: planted_contact.gfc(g, 2, 2, 2, 3, symmetric=bool(g.integers(2))),
    "fcm": lambda g: planted_contact.fcm(g, 2, 2, 3, _mild(g)),
    "rfc-3": lambda g: planted_contact.rfc(g, 2, 3, _mild(g)),
    "rfc-5": lambda g: planted_contact.rfc(g, 2, 5, _mild(g)),
    "grfc": lambda g: planted_contact.grfc(g, 2, 2, 1, 5),
    "afc": lambda g: planted_contact.afc(g, 2, _mild(g)),
    "nfc": lambda g: nonlinear.nfc(g, 2, 2, 3),
    "ncp": lambda g: nonlinear.ncp(g, 4, _mild(g)),
    "micp": lambda g: nonlinear.micp(g, 4, _mild(g)),
    "equation": lambda g: nonlinear.equation(g, 4, _mild(g)),
    "ge-box": lambda g: nonlinear.ge(g, 4, None, _mild(g)),
    "ge-cones": lambda g: nonlinear.ge(g, 2, nonlinear.product(g, cones=True), _mild(g)),
    "cp": lambda g: nonlinear.cp(g, ProductCone.of((Cone.SECOND_ORDER, 1, 3, 0.5), (Cone.NONNEGATIVE, 1, 2)), 2),
    "vi-rows": lambda g: nonlinear.vi(g, 4, None, 2, 1, 1, _mild(g)),
    "vi-cones": lambda g: nonlinear.vi(g, 2, ProductCone.of((Cone.CYLINDER, 1, 3, 0.75), (Cone.BALL, 1, 2, 0.8)), 1),
    "qvi-box": lambda g: nonlinear.moving_box(g, 4, _mild(g)),
    "qvi-friction": lambda g: nonlinear.friction_as_qvi(g, 2, 3, _mild(g)),
    "qvi-rows": lambda g: nonlinear.moving_rows(g, 4, 2, _mild(g)),
    "nlp": lambda g: nonlinear.nlp(g, 4, 2, 1),
}


def vector(problem: Any, point: Any) -> np.ndarray:
    return np.concatenate([getattr(point, name) for name in problem.point_sizes])


def _right(rng: RNG, problem: Any, point: Any, tolerance: float) -> Any:
    x = vector(problem, point)
    for group in groups(pairs_of(problem, point)):
        x[group] *= 1.0 + tolerance / 100.0 * rng.uniform(-1.0, 1.0)
    return problem.point_from_vector(x)


def missed_by(problem: Any, point: Any) -> float:
    """The error of an answer in whatever units are chosen is at least this: the largest defect over the largest row,
    by the unknown's slope where that is less than 1."""
    pairs = pairs_of(problem, point)
    size = max(1.0, float(pairs.sizes().max(initial=0.0)))
    slope = np.concatenate([np.abs(pairs.J).max(axis=0, initial=0.0), np.ones(pairs.values.size)])
    defects = pairs.defects()
    least = [min(1.0, slope[pairs.a_is[rows]].min(), slope[pairs.b_is[rows]].min()) for rows, _ in pairs.factors]
    return float(np.max(defects * np.array(least), initial=0.0)) / size


def _candidates(rng: RNG, problem: Any, point: Any) -> Iterator[np.ndarray]:
    x = vector(problem, point)
    live = [group for group in groups(pairs_of(problem, point)) if np.abs(x[group]).max(initial=0.0) > 0.1]
    rng.shuffle(live)
    for group in live:
        for factor in rng.permutation([2.0, 0.0, -1.0]):
            changed = x.copy()
            changed[group] *= factor
            yield changed
    for factor in (2.0, 0.0, -1.0, 5.0):
        yield factor * x


def _wrong(rng: RNG, problem: Any, point: Any, tolerance: float) -> Any | None:
    for x in _candidates(rng, problem, point):
        wrong = problem.point_from_vector(x)
        if missed_by(problem, wrong) >= 200.0 * tolerance:
            return wrong
    return None


_CONSTANTS = ("q", "a", "b", "d", "p", "s", "f", "w", "F", "g", "h")
"""Data that hold the constants of rows."""


def _missed(rng: RNG, problem: Any, point: Any, tolerance: float) -> Any | None:
    """The problem with one constant changed, so that the answer misses one row and is right in all others."""
    names = [name for name in _CONSTANTS if _rows(problem, name)]
    size = float(pairs_of(problem, point).sizes().max(initial=0.0))
    for _ in range(20):
        name = str(rng.choice(names))
        offset = np.zeros(_rows(problem, name))
        offset[rng.integers(offset.size)] = float(rng.choice([-1.0, 1.0])) * size * rng.uniform(0.2, 1.0)
        changed = dataclasses.replace(problem, **{name: _plus(getattr(problem, name), offset)})
        if missed_by(changed, point) >= 200.0 * tolerance:
            return changed
    return None


def _rows(problem: Any, name: str) -> int:
    value = getattr(problem, name, ())
    if isinstance(value, Map):
        return 0 if (problem.node, name) == ("nlp", "f") else value.rows
    return int(np.size(value))


def _plus(value: Any, offset: np.ndarray) -> Any:
    import casadi as ca

    if not isinstance(value, Map):
        return value + offset
    x = ca.SX.sym("x", value.inputs)
    return Map.from_casadi(x, value.sx(x) + ca.DM(offset))


def answers(variant: str, rng: RNG) -> Iterator[Answer]:
    """A right answer, a wrong one to the same problem, and one to a problem of which it misses one row, at a tolerance
    that is drawn."""
    problem, point = VARIANTS[variant](rng)
    tolerance = float(rng.choice(TOLERANCES))
    right = _right(rng, problem, point, tolerance)
    yield Answer(problem, right, tolerance, True)
    wrong = _wrong(rng, problem, point, tolerance)
    if wrong is not None:
        yield Answer(problem, wrong, tolerance, False)
    other = _missed(rng, problem, right, tolerance)
    if other is not None:
        yield Answer(other, right, tolerance, False)
