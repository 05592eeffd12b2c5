"""Planted cases of every node, with the corner shapes that break plugins."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cpbench.formulations import LCP, MLCP, QP, FrictionContact, LCPPoint, Problem
from cpbench.formulations.conic import ConicProblem
from cpbench.formulations.expressions import Map
from cpbench.formulations.expressions.recording import MapRecorder
from cpbench.generators import generators
from cpbench.testing import (
    cases_conic,
    cases_contact,
    cases_nonlinear,
    corners,
    corners_conic,
    corners_contact,
    planted,
    planted_conic,
    planted_contact,
)


@dataclass(frozen=True, eq=False)
class Case:
    """A problem with a solution that the data were made for."""

    name: str
    problem: Any
    point: Any


@cache
def cases(node: str) -> list[Case]:
    """Build dense and sparse ones, n = 0 and 1, degenerate, frictionless, singular, nonsymmetric, zero rows, units of
    1e±8.

    Of a formulation that has no such cases, the problems of its generators whose solution is known.
    """
    named: dict[str, tuple[Problem, Any]] = {}
    for makers in _ALL_MAKERS:
        if node in makers:
            named |= makers[node]()
    if not named:  # a formulation that has no cases here: its generators have some
        solved = (i for one in generators if one.node == node for i in one.instances() if i.solution is not None)
        named = {instance.name: (instance.problem, instance.solution) for instance in solved}
    return [Case(name, dataclasses.replace(problem, name=name), point) for name, (problem, point) in named.items()]


def infeasible(node: str) -> list[Case]:
    """Return problems of the node that have no solution (their point is None)."""
    if node == "lcp":  # w₁ = −z₂ − z₃ − 10⁻⁴ < 0; w = −z − 1 < 0
        pang = LCP(M=np.array([[0.0, -1, -1], [1, 0, 0], [-1, 0, 1]]), q=[-1e-4, -1, 1])
        return [Case("pang", pang, None), Case("negative", LCP(M=-np.eye(2), q=-np.ones(2)), None)]
    if node == "qp":  # z ≥ 1 and −z ≥ 1
        crossed = QP.build(np.eye(1), np.zeros(1), A=np.array([[1.0], [-1.0]]), b=np.ones(2))
        return [Case("crossed", crossed, None)]
    if node == "mlcp":  # 0 = 1 in the equalities; w = −v − 1 < 0 with u idle
        no_row = MLCP(A=np.zeros((1, 1)), B=np.eye(1), C=np.zeros((1, 1)), D=np.zeros((1, 1)), a=[1.0], b=[0.0])
        negative = MLCP(A=np.eye(1), B=-np.eye(1), C=np.zeros((1, 1)), D=np.zeros((1, 1)), a=[0.0], b=[-1.0])
        return [Case("no-row", no_row, None), Case("negative", negative, None)]
    others = corners_contact.infeasible(node) | corners_conic.infeasible(node) | cases_nonlinear.infeasible(node)
    return [Case(name, problem, None) for name, problem in others.items()]


def draw(node: str, seed: int, size: int) -> Case:
    """Return a random case; what hypothesis draws are the seed and the size. Of a formulation without random cases,
    one of the others."""
    rng = np.random.default_rng(seed)
    if not any(node in makers for makers in _ALL_MAKERS):
        return cases(node)[int(rng.integers(len(cases(node))))]
    sparse = bool(rng.integers(2))
    kind = str(rng.choice(["positive definite", "singular semidefinite", "monotone", "any"]))
    nonlinear = cases_nonlinear.draw(node, rng, size, kind)
    if nonlinear is not None:
        return Case(f"{kind}-{size}-{seed}", *nonlinear)
    problem, point = {
        "lcp": lambda: planted.lcp(rng, size, kind, sparse=sparse),
        "mlcp": lambda: planted.mlcp(rng, size, int(rng.integers(0, size + 1)), kind, sparse=sparse),
        "qp": lambda: planted.qp(rng, size, int(rng.integers(0, 4)), min(size, int(rng.integers(0, 3))), sparse=sparse),
        "fc": lambda: planted.fc(rng, size, int(rng.integers(2, 4)), kind, sparse=sparse),
        "gfc": lambda: planted_contact.gfc(
            rng, size + 1, size, int(rng.integers(0, 3)), int(rng.integers(2, 4)), sparse=sparse
        ),
        "fcm": lambda: planted_contact.fcm(
            rng, size, int(rng.integers(0, 3)), int(rng.integers(2, 4)), kind, sparse=sparse
        ),
        "rfc": lambda: planted_contact.rfc(rng, size, int(rng.choice([3, 5])), kind, sparse=sparse),
        "grfc": lambda: planted_contact.grfc(
            rng, size + 1, size, int(rng.integers(0, 3)), int(rng.choice([3, 5])), sparse=sparse
        ),
        "afc": lambda: planted_contact.afc(rng, size, kind, sparse=sparse),
        "relay": lambda: planted_conic.relay(rng, size, kind, sparse=sparse),
        "avi": lambda: planted_conic.avi(
            rng, size, int(rng.integers(0, 4)), min(size, int(rng.integers(0, 3))), kind, sparse=sparse
        ),
        "soclcp": lambda: planted_conic.soclcp(rng, None, kind, sparse=sparse),
        "coneqp": lambda: planted_conic.coneqp(
            rng, size, None, "positive definite" if kind in ("monotone", "any") else kind, sparse=sparse
        ),
    }[node]()
    return Case(f"{kind}-{size}-{seed}", problem, point)


_SYMBOLS: dict[str, dict[str, tuple[str, ...]]] = {
    "lcp": {"n": ("z",)},
    "mlcp": {"n": ("u",), "m": ("v",)},
    "qp": {"n": ("z", "nu"), "m": ("lam",), "k": ("mu",)},
    "fc": {"m": ("r",), "nc": ()},
    "gfc": {"n": ("v",), "m": ("r",), "nc": (), "p": ("lam",)},
    "fcm": {"m": ("r",), "nc": (), "p": ("lam",)},
    "rfc": {"m": ("r",), "nc": ()},
    "grfc": {"n": ("v",), "m": ("r",), "nc": (), "p": ("lam",)},
    "afc": {"m": ("r",), "nc": ()},
    "relay": {"n": ("z",)},
    "avi": {"n": ("z",), "m": ("lam",), "k": ("mu",)},
    "soclcp": {"n": ("x",), "k": ()},
    "coneqp": {"n": ("x",), "m": ("y",), "k": ()},
    "ncp": {"n": ("z",)},
    "micp": {"n": ("z",)},
    "equation": {"n": ("z",)},
    "nlp": {"n": ("z", "nu"), "m": ("lam",), "k": ("mu",)},
    "vi": {"n": ("z",), "m": ("lam",), "k": ("mu",), "p": ("nu",), "c": ()},
    "ge": {"n": ("z",), "c": ()},
    "cp": {"n": ("x",), "m": ("lam",), "c": ()},
    "qvi": {"n": ("z",), "p": ("nu",), "c": ()},
    "nfc": {"n": ("v",), "m": ("r",), "nc": ()},
}
"""Dimensions of a node whose order has no meaning, with the parts of a point that they count."""


_NO_ROWS = np.zeros(0, dtype=np.int64)


def renumbered(case: Case, seed: int) -> Case | None:
    """Return the same problem with unknowns, rows and contacts in another order; None for a node that is not known
    here."""
    symbols = _SYMBOLS.get(case.problem.node)
    if symbols is None:
        return None
    rng = _rng(seed)
    order = {symbol: rng.permutation(case.problem.sizes()[symbol]) for symbol in symbols}
    if "nc" in order:  # the rows of a contact stay together, normal first
        d = case.problem.dimension
        order["m"] = (d * order["nc"][:, None] + np.arange(d)).ravel()
    if isinstance(case.problem, ConicProblem):  # so do those of a factor
        rows = np.split(np.arange(case.problem.K.rows), np.cumsum(case.problem.cone_size.astype(int))[:-1])
        factors = order["c" if "c" in order else "k"]
        if factors.size:
            order["m" if case.problem.node == "coneqp" else "n"] = np.concatenate(
                [_NO_ROWS, *(rows[i] for i in factors)]
            )
    if case.problem.node == "qvi":  # g is of (y, z); the bounds that move are as many as the unknowns, or none
        n = order["n"].size
        order |= {"2n": np.concatenate([order["n"], n + order["n"]])}
        order |= {s: order["n"] if case.problem.sizes()[s] else _NO_ROWS for s in ("nl", "nu")}
    data: dict[str, Any] = {}
    for field in dataclasses.fields(case.problem):
        if "shape" in field.metadata:
            rows, *columns = (order.get(symbol, slice(None)) for symbol in field.metadata["shape"])
            value = getattr(case.problem, field.name)[rows]
            data[field.name] = value[:, columns[0]] if columns else value
        elif "map" in field.metadata and getattr(case.problem, field.name).rows:
            rows, columns = (order.get(symbol, _NO_ROWS) for symbol in field.metadata["map"])
            data[field.name] = _reordered(getattr(case.problem, field.name), rows, columns)
    parts = {name: getattr(case.point, name)[order[symbol]] for symbol, names in symbols.items() for name in names}
    return Case(case.name, dataclasses.replace(case.problem, **data), type(case.point)(**parts))


def _reordered(F: Map, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> Map:
    """Return x[columns] ↦ F(x)[rows]; the map to ℝ¹ has no rows to reorder."""
    record = MapRecorder(F.inputs)
    value = record(F, record.z[np.argsort(columns)])
    return record.map(value[rows] if rows.size else value)


def _rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


def _lcp() -> dict[str, tuple[Problem, Any]]:
    named: dict[str, tuple[Problem, Any]] = {
        kind.replace(" ", "-"): planted.lcp(_rng(i), 12, kind) for i, kind in enumerate(planted.SQUARE)
    }
    named["sparse"] = planted.lcp(_rng(10), 12, "positive definite", sparse=True)
    named["one"] = (LCP(M=np.eye(1), q=[-2.0]), LCPPoint(z=[2.0]))
    named["empty"] = (LCP(M=np.zeros((0, 0)), q=[]), LCPPoint(z=[]))
    named["trivial"] = (LCP(M=np.eye(4), q=np.ones(4)), LCPPoint(z=np.zeros(4)))
    problem, point = planted.lcp(_rng(11), 8, "positive definite")
    scale = 10.0 ** np.array([-4, 4, 0, 2, -2, 3, -3, 1])
    named["badly-scaled"] = (
        LCP(M=problem.M * scale[:, None] * scale, q=problem.q * scale),
        LCPPoint(z=point.z / scale),
    )
    return named


def _mlcp() -> dict[str, tuple[Problem, Any]]:
    return {
        "monotone": planted.mlcp(_rng(0), 6, 8, "monotone"),
        "positive-definite": planted.mlcp(_rng(1), 6, 8, "positive definite"),
        "sparse": planted.mlcp(_rng(2), 6, 8, "positive definite", sparse=True),
        "singular-A": planted.mlcp(_rng(3), 5, 5, "singular"),
        "no-equality": planted.mlcp(_rng(4), 0, 6, "positive definite"),
        "equalities-only": planted.mlcp(_rng(5), 6, 0, "positive definite"),
        "empty": planted.mlcp(_rng(6), 0, 0, "positive definite"),
    }


def _qp() -> dict[str, tuple[Problem, Any]]:
    return {
        "definite": planted.qp(_rng(0), 10, 6, 3),
        "sparse": planted.qp(_rng(1), 10, 6, 3, sparse=True),
        "singular": planted.qp(_rng(2), 10, 6, 2, "singular semidefinite"),
        "no-constraint-rows": planted.qp(_rng(3), 8, 0, 0),
        "no-equality": planted.qp(_rng(4), 8, 5, 0),
        "one": planted.qp(_rng(5), 1, 1, 0),
    }


def _fc() -> dict[str, tuple[Problem, Any]]:
    named: dict[str, tuple[Problem, Any]] = {
        f"{kind.replace(' ', '-')}-{d}d": planted.fc(_rng(i), 5, d, kind)
        for i, kind in enumerate(planted.SQUARE[:3])
        for d in (2, 3)
    }
    named["sparse-3d"] = planted.fc(_rng(10), 5, 3, "positive definite", sparse=True)
    named["nonsymmetric-3d"] = planted.fc(_rng(11), 3, 3, "any")
    named["one-3d"] = planted.fc(_rng(12), 1, 3, "positive definite")
    problem, point = planted.fc(_rng(13), 4, 3, "positive definite")
    named["frictionless-3d"] = _without_friction(problem, point)
    named["empty-3d"] = planted.fc(_rng(14), 0, 3, "positive definite")
    return named


def _without_friction(problem: FrictionContact, point: Any) -> tuple[Problem, Any]:
    """Return μ = 0: only normal reactions, each contact either pushes at rest or is open."""
    r, u = np.zeros((problem.nc, 3)), np.zeros((problem.nc, 3))
    r[::2, 0], u[1::2, 0], u[:, 1] = 1.5, 0.5, 0.25
    W = problem.W
    replaced = FrictionContact(W=W, q=u.ravel() - W @ r.ravel(), mu=np.zeros(problem.nc), dimension=3)
    return replaced, type(point)(r=r.ravel())


def _gfc() -> dict[str, tuple[Problem, Any]]:
    return {
        "symmetric-3d": planted.gfc(_rng(0), 3, 4, 3),
        "sparse-3d": planted.gfc(_rng(1), 3, 4, 3, sparse=True),
        "nonsymmetric-3d": planted.gfc(_rng(2), 3, 4, 3, symmetric=False),
        "plane-2d": planted.gfc(_rng(3), 2, 3, 2),
        "no-contact": planted.gfc(_rng(4), 2, 0, 3),
        **cases_contact.gfc_with_joints(),
    }


_MAKERS = {"lcp": _lcp, "mlcp": _mlcp, "qp": _qp, "fc": _fc, "gfc": _gfc}
_ALL_MAKERS = (
    _MAKERS,
    cases_contact.MAKERS,
    cases_conic.MAKERS,
    cases_nonlinear.MAKERS,
    corners.MAKERS,
    corners_contact.MAKERS,
    corners_conic.MAKERS,
)
