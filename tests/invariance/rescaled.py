"""Problems written in other units and with other signs: exact in binary arithmetic, for all factors are powers of two.

A table says by what the data, the inputs of the maps and the parts of an answer are multiplied. Scales that are tied
to each other are so by the problem: the objective's (`o`) by that of its multipliers, H's rows by its columns.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from answers import RNG, Answer

from cpbench.formulations.conic import ConicProblem
from cpbench.formulations.expressions import Map
from cpbench.foundation.cones import Cone

Vector = np.ndarray
Scale = Any
"""A vector, a number, or (rows, columns) of a matrix, (values, inputs) of a map."""
Rescaling = tuple[Mapping[str, Scale], Mapping[str, Scale]]
Draw = Callable[[int], Vector]


@dataclasses.dataclass(frozen=True)
class Draws:
    """Scales of unknowns and rows. `positive` and `signed` draw n numbers, `signed` where a sign has no meaning."""

    positive: Draw
    signed: Draw

    def shared(self, sizes: Vector) -> Vector:
        """One number for every group of components."""
        return np.repeat(self.positive(sizes.size), sizes.astype(int))


def units(rng: RNG, most: int = 60) -> Draws:
    def draw(n: int) -> Vector:
        return 2.0 ** rng.integers(-most, most + 1, n)

    return Draws(draw, draw)


def one_unit(rng: RNG, most: int = 40) -> Draws:
    """The same units for all unknowns of one kind, and for all rows of one kind."""

    def draw(n: int) -> Vector:
        return np.full(n, 2.0 ** rng.integers(-most, most + 1))

    return Draws(draw, draw)


def signs(rng: RNG) -> Draws:
    return Draws(np.ones, lambda n: rng.choice([-1.0, 1.0], n))


def _cone_groups(p: ConicProblem) -> Vector:
    alone = np.isin(p.K.kind, (Cone.ZERO, Cone.FREE, Cone.NONNEGATIVE))
    return np.concatenate([np.ones(int(s)) if a else [s] for s, a in zip(p.K.size, alone, strict=True)] or [[]])


def _radius(p: ConicProblem, scale: Vector, *kinds: Cone) -> Vector:
    """1 a factor, and the scale of its rows where μ is a length."""
    first = (np.cumsum(p.K.size) - p.K.size).astype(int)
    return np.array([scale[k] if kind in kinds else 1.0 for k, kind in zip(first, p.K.kind, strict=True)])


def _pair(p: Any, s: Draws, groups: Vector | None = None) -> tuple[Vector, Vector]:
    """Scales e of the rows and d of the unknowns (x = d x′) of x ⟂ Mx + q."""
    groups = np.ones(p.q.size) if groups is None else groups
    return s.shared(groups), s.shared(groups)


def _lcp(p: Any, s: Draws) -> Rescaling:
    e, d = _pair(p, s)
    return {"M": (e, d), "q": e}, {"z": 1 / d}


def _mlcp(p: Any, s: Draws) -> Rescaling:
    n, m = p.a.size, p.b.size
    e, d, f, g = s.signed(n), s.signed(n), s.positive(m), s.positive(m)
    return {"A": (e, d), "C": (e, g), "a": e, "D": (f, d), "B": (f, g), "b": f}, {"u": 1 / d, "v": 1 / g}


def _relay(p: Any, s: Draws) -> Rescaling:
    e, d = _pair(p, s)
    return {"M": (e, d), "q": e, "lb": 1 / d, "ub": 1 / d}, {"z": 1 / d}


def _rows(d: Vector, o: Scale, e: Vector, f: Vector) -> Rescaling:
    bounds = {"lb": 1 / d, "ub": 1 / d}
    return {"A": (e, d), "b": e, "C": (f, d), "d": f, **bounds}, {"z": 1 / d, "lam": o / e, "mu": o / f}


def _affine_rows(p: Any, s: Draws, force: tuple[str, str]) -> Rescaling:
    d, o = s.positive(p.lb.size), s.positive(1)
    data, parts = _rows(d, o, s.positive(p.b.size), s.signed(p.d.size))
    return {**data, force[0]: (o * d, d), force[1]: o * d}, {**parts, "nu": o * d}


def _coneqp(p: Any, s: Draws) -> Rescaling:
    d, o, e = s.signed(p.p.size), s.positive(1), s.shared(_cone_groups(p))
    data = {"Q": (o * d, d), "p": o * d, "A": (e, d), "b": e, "cone_mu": _radius(p, e, Cone.CYLINDER)}
    return data, {"x": 1 / d, "y": o / e}


def _soclcp(p: Any, s: Draws) -> Rescaling:
    e, d = _pair(p, s, _cone_groups(p))
    return {"M": (e, d), "q": e}, {"x": 1 / d}


def _frames(p: Any, s: Draws) -> Vector:
    """Signs of tangent directions and of axes of rotation."""
    flips = s.signed(p.nc * p.dimension).reshape(p.nc, p.dimension)
    flips = np.sign(flips)
    flips[:, 0] = 1.0
    return flips.ravel()


def _at_contacts(p: Any, s: Draws) -> Vector:
    """One unit for all contacts, whose velocities are compared with each other, and signs."""
    return s.shared(np.array([p.nc * p.dimension])) * _frames(p, s)


def _local(p: Any, s: Draws) -> Rescaling:
    """Work has one unit at all contacts, or W of symmetric mechanics would be symmetric no more."""
    d, o = _at_contacts(p, s), s.positive(1)
    return {"W": (o * d, d), "q": o * d}, {"r": 1 / d}


def _fcm(p: Any, s: Draws) -> Rescaling:
    data, parts = _local(p, s)
    e, d = data["W"]
    f = s.signed(p.s.size)
    g = f * (d / e)[0]  # V and Vᵀ are the same numbers
    return {**data, "V": (e, g), "R": (f, g), "s": f}, {**parts, "lam": 1 / g}


def _dynamics(p: Any, s: Draws) -> tuple[Vector, Scale, Vector, Rescaling]:
    d, o = s.signed(p.H.shape[0]), s.positive(1)
    c = _at_contacts(p, s)
    data = {"H": (o * d, c), "w": o * c}
    return d, o, c, (data, {"v": 1 / d, "r": 1 / c})


def _gfc(p: Any, s: Draws) -> Rescaling:
    d, o, _, (data, parts) = _dynamics(p, s)
    g = s.signed(p.b.size)
    data = {**data, "M": (o * d, d), "f": o * d, "G": (o * d, g), "b": o * g}
    return data, {**parts, "lam": 1 / g}


def _nfc(p: Any, s: Draws) -> Rescaling:
    d, o, _, (data, parts) = _dynamics(p, s)
    return {**data, "F": (o * d, d), "start": 1 / d}, parts


def _free(p: Any, s: Draws) -> Rescaling:
    n = p.start.size
    d = s.signed(n)
    return {"F": (s.signed(n), d), "start": 1 / d}, {"z": 1 / d}


def _ncp(p: Any, s: Draws) -> Rescaling:
    d = s.positive(p.start.size)
    return {"F": (s.positive(d.size), d), "start": 1 / d}, {"z": 1 / d}


def _micp(p: Any, s: Draws) -> Rescaling:
    data, parts = _ncp(p, s)
    return {**data, "lb": data["start"], "ub": data["start"]}, parts


def _ge(p: Any, s: Draws) -> Rescaling:
    groups = _cone_groups(p) if p.cone_kind.size else np.ones(p.start.size)
    e, d = s.shared(groups), s.shared(groups)
    data = {"F": (e, d), "start": 1 / d, "lb": 1 / d, "ub": 1 / d}
    return data | {"cone_mu": _radius(p, 1 / d, Cone.BALL, Cone.CYLINDER)} if p.cone_kind.size else data, {"z": 1 / d}


def _vi(p: Any, s: Draws) -> Rescaling:
    d = s.shared(_cone_groups(p)) if p.cone_kind.size else s.positive(p.start.size)
    o, g = s.positive(1), s.positive(p.g.rows)
    data, parts = _rows(d, o, s.positive(p.b.size), s.signed(p.d.size))
    data = {**data, "F": (o * d, d), "g": (g, d), "start": 1 / d}
    if p.cone_kind.size:
        data["cone_mu"] = _radius(p, 1 / d, Cone.BALL, Cone.CYLINDER)
    return data, {**parts, "nu": o / g}


def _qvi(p: Any, s: Draws) -> Rescaling:
    d = s.shared(_cone_groups(p)) if p.cone_kind.size else s.positive(p.start.size)
    o, g = s.positive(1), s.positive(p.g.rows)
    data = {"F": (o * d, d), "g": (g, np.concatenate([d, d])), "lower": (1 / d, d), "upper": (1 / d, d)}
    return {**data, "lb": 1 / d, "ub": 1 / d, "start": 1 / d}, {"z": 1 / d, "nu": o / g}


def _cp(p: Any, s: Draws) -> Rescaling:
    d, o, e = s.shared(_cone_groups(p)), s.positive(1), s.positive(p.A.shape[0])
    return {"F": (o * d, d), "A": (e, d), "start": 1 / d}, {"x": 1 / d, "lam": o / e}


def _nlp(p: Any, s: Draws) -> Rescaling:
    d, o, e, f = s.positive(p.start.size), s.positive(1), s.positive(p.g.rows), s.signed(p.h.rows)
    data = {"f": (o, d), "g": (e, d), "h": (f, d), "lb": 1 / d, "ub": 1 / d, "start": 1 / d}
    return data, {"z": 1 / d, "lam": o / e, "mu": o / f, "nu": o * d}


_NODES: dict[str, Callable[[Any, Draws], Rescaling]] = {
    "lcp": _lcp,
    "mlcp": _mlcp,
    "relay": _relay,
    "avi": lambda p, s: _affine_rows(p, s, ("M", "q")),
    "qp": lambda p, s: _affine_rows(p, s, ("Q", "p")),
    "coneqp": _coneqp,
    "soclcp": _soclcp,
    **dict.fromkeys(("fc", "rfc", "afc"), _local),
    "fcm": _fcm,
    **dict.fromkeys(("gfc", "grfc"), _gfc),
    "nfc": _nfc,
    "ncp": _ncp,
    "micp": _micp,
    "equation": _free,
    "ge": _ge,
    "cp": _cp,
    "vi": _vi,
    "qvi": _qvi,
    "nlp": _nlp,
}


def _times(value: Any, scale: Scale) -> Any:
    if isinstance(value, Map):
        return rescaled_map(value, *scale) if value.rows else value
    if isinstance(scale, tuple):
        rows, columns = scale
        if hasattr(value, "tocsr"):
            import scipy.sparse as sp

            return sp.diags_array(np.asarray(rows)) @ value @ sp.diags_array(np.asarray(columns))
        return rows[:, None] * value * columns
    return value * scale


def rescaled_map(F: Map, values: Vector, inputs: Vector) -> Map:
    """x ↦ values · F(inputs · x)."""
    import casadi as ca

    x = ca.SX.sym("x", F.inputs)
    return Map.from_casadi(x, ca.DM(values) * F.sx(ca.DM(inputs) * x))


def rescaled(answer: Answer, draws: Draws) -> Answer:
    data, parts = _NODES[answer.problem.node](answer.problem, draws)
    fields = {name: _times(getattr(answer.problem, name), scale) for name, scale in data.items()}
    problem = dataclasses.replace(answer.problem, **fields)
    point = {name: value * parts[name] for name, value in answer.point.arrays().items()}
    return answer.of(problem, type(answer.point)(**point))
