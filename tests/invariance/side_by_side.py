"""Problems beside each other, and idle ones beside a problem: bounds, rows, unknowns and contacts far from active."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import rescaled
import scipy.linalg as sl
from answers import RNG, VARIANTS, Answer
from planted_nonlinear import graph

from cpbench.formulations import formulations
from cpbench.formulations.conic import cone_fields
from cpbench.formulations.expressions import Map
from cpbench.foundation import matrices
from cpbench.foundation.cones import Cone, ProductCone


def together(first: tuple[Any, Any], second: tuple[Any, Any]) -> tuple[Any, Any]:
    """Two independent problems of a node as one, with both answers."""
    (p, x), (q, y) = first, second
    data: dict[str, Any] = {}
    for field in dataclasses.fields(p):
        one, other = getattr(p, field.name), getattr(q, field.name)
        if "map" in field.metadata:
            data[field.name] = _maps(one, other, field.metadata["map"])
        elif len(field.metadata.get("shape", ())) == 2 and field.metadata["shape"][1].isalpha():
            data[field.name] = sl.block_diag(matrices.dense(one), matrices.dense(other))
        elif "shape" in field.metadata:
            data[field.name] = np.concatenate([one, other])
    parts = {name: np.concatenate([value, getattr(y, name)]) for name, value in x.arrays().items()}
    return dataclasses.replace(p, **data), type(x)(**parts)


def _maps(F: Map, G: Map, shape: tuple[str, str]) -> Map:
    """(x, y) ↦ (F(x), G(y)), the sum where the map is one number."""
    import casadi as ca

    n = F.inputs + G.inputs
    if not F.rows + G.rows:
        return Map.empty(n)
    k = 2 if shape[1].startswith("2") else 1
    halves = [np.arange(F.inputs).reshape(k, -1), np.arange(G.inputs).reshape(k, -1)]
    order = np.concatenate([half[j] + at for j in range(k) for half, at in zip(halves, (0, F.inputs), strict=True)])
    place = np.argsort(order).tolist()
    z = ca.SX.sym("z", n)
    x = z[place]
    values = [H.sx(x[at : at + H.inputs]) for H, at in ((F, 0), (G, F.inputs)) if H.rows]
    return Map.from_casadi(z, sum(values) if shape[0] == "1" else ca.vertcat(*values))


PROGRAMS = ("qp", "coneqp", "nlp")


def _apart(problem: Any) -> int:
    """Bits between the units of two problems. Programs have one objective, and of scenes one that moves 2^-40 as fast
    as another counts as at rest: velocities are apart by twice as much."""
    return 10 if problem.node in PROGRAMS else 15 if hasattr(problem, "dimension") else 40


def union(answer: Answer, rng: RNG, variant: str) -> Iterator[Answer]:
    """Beside a right answer in other units, before it and after it."""
    right = Answer(*VARIANTS[variant](rng), answer.tolerance, True)
    other = rescaled.rescaled(right, rescaled.one_unit(rng, _apart(answer.problem)))
    for pair in ((answer, other), (other, answer)):
        yield answer.of(*together(*((a.problem, a.point) for a in pair)))


Idle = Callable[[Any, float, float], tuple[dict[str, Any], list[Any]]]
"""Data and answer of an idle problem: of the same class as one, with a force and a side far from active."""


def _contact(p: Any, force: float, *, dynamic: bool) -> tuple[dict[str, Any], list[Any]]:
    d = p.dimension
    eye, open_, zero = np.eye(d), np.concatenate([[force], np.zeros(d - 1)]), np.zeros(d)
    mu = {"mu": np.full((1, 2) if p.node == "afc" else 1, 0.5)} | ({"mu_r": [0.5]} if hasattr(p, "mu_r") else {})
    if not dynamic:
        return {"W": eye, "q": open_, **mu}, [zero]
    fall = np.concatenate([[1.0], np.zeros(d - 1)])
    return {"M": eye, "H": eye, "f": fall, "w": open_, **mu}, [fall, zero]


def _mixed_contact(p: Any, force: float, side: float) -> tuple[dict[str, Any], list[Any]]:
    data, parts = _contact(p, force, dynamic=False)
    return {**data, "V": np.zeros((p.dimension, 0)), "R": np.zeros((0, 0)), "s": []}, [*parts, []]


def _nonlinear_contact(p: Any, force: float, side: float) -> tuple[dict[str, Any], list[Any]]:
    data, parts = _contact(p, force, dynamic=True)
    fall = data.pop("f")
    del data["M"]
    return {**data, "F": graph(p.dimension, lambda v: v - fall), "start": np.zeros(p.dimension)}, parts


def _far(side: float) -> dict[str, Any]:
    return {"lb": [-side], "ub": [side]}


def _moving(p: Any, force: float, side: float) -> tuple[dict[str, Any], list[Any]]:
    """z = 1 where F = z − 1, with bounds far away; a free factor where the problem has factors."""
    data = {"F": graph(1, lambda x: x - 1.0), "start": [0.0], **_far(side)}
    if p.cone_kind.size:
        data |= cone_fields(ProductCone.of((Cone.FREE, 1, 1)))
    for name in ("lower", "upper"):
        if hasattr(p, name) and getattr(p, name).rows:
            data[name] = graph(1, lambda x, s=-side if name == "lower" else side: s + 0.0 * x)
    return data, [[1.0]]


_ONE = np.ones((1, 1))
_NONE = np.zeros((0, 0))
_SOC = cone_fields(ProductCone.of((Cone.SECOND_ORDER, 1, 3, 0.5)))
_RAY = cone_fields(ProductCone.of((Cone.NONNEGATIVE, 1, 1)))
_RIGID = dict.fromkeys(("gfc", "grfc"), lambda p, force, side: _contact(p, force, dynamic=True))
_LOCAL = dict.fromkeys(("fc", "rfc", "afc"), lambda p, force, side: _contact(p, force, dynamic=False))
_IDLE: dict[str, Idle] = {
    "lcp": lambda p, force, side: ({"M": _ONE, "q": [force]}, [[0.0]]),
    "mlcp": lambda p, force, side: (
        {"A": _NONE, "B": _ONE, "C": np.zeros((0, 1)), "D": np.zeros((1, 0)), "a": [], "b": [force]},
        [[], [0.0]],
    ),
    "relay": lambda p, force, side: ({"M": _ONE, "q": [-1.0], **_far(side)}, [[1.0]]),
    "avi": lambda p, force, side: (
        {"M": _ONE, "q": [-1.0], "A": _ONE, "b": [-side], **_far(side)},
        [[1.0], [0.0], []],
    ),
    "qp": lambda p, force, side: (
        {"Q": _ONE, "p": [-1.0], "A": _ONE, "b": [-side], "C": np.zeros((0, 1)), "d": [], **_far(side)},
        [[1.0], [0.0], [], [0.0]],
    ),
    "coneqp": lambda p, force, side: ({"Q": _ONE, "p": [-1.0], "A": _ONE, "b": [force], **_RAY}, [[1.0], [0.0]]),
    "soclcp": lambda p, force, side: ({"M": np.eye(3), "q": [force, 0.0, 0.0], **_SOC}, [np.zeros(3)]),
    **_LOCAL,
    "fcm": _mixed_contact,
    **_RIGID,
    "nfc": _nonlinear_contact,
    "ncp": lambda p, force, side: ({"F": graph(1, lambda x: x + force), "start": [0.0]}, [[0.0]]),
    "cp": lambda p, force, side: ({"F": graph(1, lambda x: x + force), "start": [0.0], **_RAY}, [[0.0], []]),
    "micp": lambda p, force, side: ({"F": graph(1, lambda x: x - 1.0), "start": [0.0], **_far(side)}, [[1.0]]),
    "ge": _moving,
    "vi": _moving,
    "qvi": _moving,
    "nlp": lambda p, force, side: (
        {
            "f": graph(1, lambda x: 0.5 * (x - 1.0) ** 2),
            "g": graph(1, lambda x: x + force),
            "start": [0.0],
            "convex": True,
            **_far(side),
        },
        [[1.0], [0.0], [], [0.0]],
    ),
}


def _sides(rng: RNG) -> tuple[float, float]:
    """A force up to 1e18, and a side up to 1e18 or one that stands for none."""
    far = 10.0 ** rng.uniform(6.0, 18.0)
    return far, float(rng.choice([far, 10.0 ** rng.uniform(19.0, 25.0)]))


def idle(answer: Answer, rng: RNG, variant: str) -> Iterator[Answer]:
    """Beside an idle problem, before it and after it. An open contact opens as fast as others close: a free velocity
    is a size, whatever the contact does."""
    p = answer.problem
    if p.node not in _IDLE:
        return
    force, side = _sides(rng)
    data, parts = _IDLE[p.node](p, 1.0 if hasattr(p, "dimension") else force, side)
    cls = formulations.get(p.node)
    keep = {name: getattr(p, name) for name in ("dimension",) if hasattr(p, name)}
    other = cls(**data, **keep), cls.point_type(*(np.asarray(part, float) for part in parts))
    for pair in (((p, answer.point), other), (other, (p, answer.point))):
        yield answer.of(*together(*pair))


COUPLED = {"lcp": "M", "soclcp": "M", "mlcp": "B"}
"""Matrices of the unknowns that are 0 in an idle problem."""


def coupled(answer: Answer, rng: RNG, variant: str) -> Iterator[Answer]:
    """Beside an idle problem whose rows and columns are not empty: its unknowns are 0, its rows far from active."""
    name = COUPLED.get(answer.problem.node)
    if name is None:
        return
    whole = next(idle(answer, rng, variant))
    M, n = np.array(getattr(whole.problem, name)), getattr(answer.problem, name).shape[0]
    M[:n, n:] = rng.standard_normal((n, M.shape[0] - n))
    M[n:, :n] = rng.standard_normal((M.shape[0] - n, n))
    yield whole.of(dataclasses.replace(whole.problem, **{name: M}), whole.point)


def idle_sides(answer: Answer, rng: RNG, variant: str) -> Iterator[Answer]:
    """Bounds and rows far from active of the problem's own unknowns, in the place of none."""
    p, x = answer.problem, answer.point
    _, side = _sides(rng)
    if hasattr(p, "lb") and p.node != "relay":
        inside = p.in_free_factor if hasattr(p, "in_free_factor") else np.ones(p.lb.size, dtype=bool)
        lb = np.where(np.isinf(p.lb) & inside, -side, p.lb)
        ub = np.where(np.isinf(p.ub) & inside, side, p.ub)
        yield answer.of(dataclasses.replace(p, lb=lb, ub=ub), x)
    if hasattr(p, "A") and hasattr(p, "b") and hasattr(x, "lam"):
        A = np.vstack([matrices.dense(p.A), rng.standard_normal(p.A.shape[1])])
        more = dataclasses.replace(p, A=A, b=np.append(p.b, -side))
        yield answer.of(more, dataclasses.replace(x, lam=np.append(x.lam, 0.0)))
